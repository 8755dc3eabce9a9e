"""Simulation error: parameters whose simulated motion is nearest to what was measured."""
