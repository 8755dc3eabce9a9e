"""Torque ripple: lines over the position in the residual."""
