"""Torques of a new log by a result, with their errors."""
