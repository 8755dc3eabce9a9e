"""Friction: maps against its states, bearings, ripple."""
