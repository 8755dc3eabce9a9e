"""Drives: gains, log units, temperature of the motors."""
