"""Records of the discrete-time benchmark of table C.3."""

import numpy as np

from tests.linear.two_impulses import TWO_IMPULSES

TRUTH = TWO_IMPULSES.theta


def impulses() -> np.ndarray:
    return TWO_IMPULSES.record(0).u


def outputs(runs: int, seed: int) -> np.ndarray:
    """Noisy outputs, shape (runs, samples)."""
    return np.array([TWO_IMPULSES.record(1000 * seed + run).y for run in range(runs)])
