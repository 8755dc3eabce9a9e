"""Symbolic models of a robot: expressions, programs, customised Newton–Euler, base parameters."""
