"""Mechanisms with closed loops: how all joints move with the independent ones, and dynamics."""
