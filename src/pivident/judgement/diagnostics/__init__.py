"""Diagnostics of results, and the verdict on them."""
