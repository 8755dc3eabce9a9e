"""Estimation: problems, methods, and the identifications they give."""
