"""Drives: gains, units of the log, temperature of the motors."""
