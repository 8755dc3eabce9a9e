"""Motions of a recording: measured, simulated, and what both have in common."""
