"""What the checks of channels share."""

from __future__ import annotations

import numpy as np


def usable_rows(*channels: np.ndarray) -> np.ndarray:
    """Indices of the samples at which every value of every channel is finite."""
    return np.flatnonzero(np.logical_and.reduce([np.isfinite(c).all(axis=1) for c in channels]))
