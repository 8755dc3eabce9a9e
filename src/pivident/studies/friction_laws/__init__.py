"""Friction laws of joints: their choice, and their shape constants."""
