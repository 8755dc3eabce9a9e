"""Identification of the dynamic parameters of robots."""
__version__ = "0.1.0"
