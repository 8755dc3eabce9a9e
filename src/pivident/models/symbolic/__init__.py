"""Models as formulas and as code."""
