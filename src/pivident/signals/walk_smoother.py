"""The random walk smoother of one channel as the linear operator S that it is.

Once its noise-to-variance ratio is chosen the smoother is linear: S can be applied to another
signal of the same length and rate, to see what the smoother makes of a motion that is known.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pivident.signals.coloured_walk_likelihood import NoiseColour, coloured_fit
from pivident.signals.random_walk_likelihood import diffuse_fit


@dataclass(frozen=True, eq=False)
class WalkSmoother:
    """S of one channel."""

    nvr: float  # noise-to-variance ratio, per sample
    order: int  # of the random walk
    colour: NoiseColour | None = None  # of the measurement noise; None: white

    def smoothed(self, y: np.ndarray) -> np.ndarray:
        """S y of a channel, shape (samples,)."""
        mean = float(np.mean(y))  # passes unchanged, and would only cost digits
        if self.colour is None:
            return diffuse_fit(y - mean, self.nvr, self.order).level + mean
        return coloured_fit(y - mean, self.nvr, self.order, self.colour).level + mean
