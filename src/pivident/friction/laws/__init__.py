"""Friction laws: their shapes, and which one a joint has."""
