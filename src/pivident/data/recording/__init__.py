"""Recordings: what was measured, read from files, checked, in SI units on the joint side."""
