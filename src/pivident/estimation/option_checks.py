"""Options of methods that make no sense are refused by name."""

from __future__ import annotations

import numpy as np

from pivident.errors import ExperimentError


def check_iteration(tolerance: float, max_iterations: int) -> None:
    """Refuse a tolerance or a number of passes that end nothing."""
    if not 0 < tolerance < 1:
        raise ExperimentError(f"tolerance must lie between 0 and 1, not {tolerance}")
    if max_iterations < 1:
        raise ExperimentError(f"max_iterations must be at least 1, not {max_iterations}")


def check_positive(name: str, value: float) -> None:
    """Refuse what is not positive and finite."""
    if not (np.isfinite(value) and value > 0.0):
        raise ExperimentError(f"{name} is {value}; it has to be positive").about(name)
