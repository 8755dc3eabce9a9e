"""Measurements of designed motions."""
