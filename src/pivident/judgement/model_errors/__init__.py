"""Causes of model error: found in the residual by their shapes, named, corrected."""
