"""Friction laws seen, chosen and fitted: maps, shapes, ripple."""
