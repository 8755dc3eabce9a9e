"""Prediction of motion that was not fitted."""
