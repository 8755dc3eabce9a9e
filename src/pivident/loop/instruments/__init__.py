"""Motions that make the instruments of a recording, from whatever the log has."""
