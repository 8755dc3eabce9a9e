"""Estimates from the lines of a periodic motion."""
