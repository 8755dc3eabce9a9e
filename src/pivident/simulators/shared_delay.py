"""One delay of all branches from their separate fits.

Each branch b has an estimate p_b with covariance C_b, in which its own delay T_b is element i. The
branches share nothing else, so that the least-squares estimate of all together is

    T = V Σ T_b/C_b,ii,   V = 1/Σ (1/C_b,ii),     p_b ← p_b - g_b (T_b - T),   g_b = C_b,·i/C_b,ii
    C_b ← C_b - C_b,·i C_b,i·/C_b,ii + V g_b g_bᵀ

and Σ (T_b - T)²/C_b,ii is χ² of one less than there are branches if the delay is one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, eq=False)
class BranchEstimate:
    """Values and covariance of a branch, and the index of its delay."""

    values: np.ndarray
    covariance: np.ndarray
    delay: int | None  # None: it is not sought


@dataclass(frozen=True, eq=False)
class SharedDelay:
    """Estimates with one delay.

    Attributes:
        branches: of each branch.
        p_value: of the hypothesis that all branches have it; NaN with less than two.
    """

    branches: tuple[BranchEstimate, ...]
    p_value: float


def with_shared_delay(estimates: Sequence[BranchEstimate]) -> SharedDelay:
    """Give all branches the same delay; a delay at its bound, without variance, is left out."""
    delays, variances = [], []
    for own in estimates:
        if own.delay is not None and own.covariance[own.delay, own.delay] > 0.0:
            delays.append(own.values[own.delay])
            variances.append(own.covariance[own.delay, own.delay])
    if len(delays) < 2:
        return SharedDelay(tuple(estimates), np.nan)
    from scipy.stats import chi2

    weights = 1.0 / np.array(variances)
    variance = float(1.0 / weights.sum())
    delay = float(variance * weights @ np.array(delays))
    spread = float(weights @ (np.array(delays) - delay) ** 2)
    return SharedDelay(
        tuple(_conditioned(own, delay, variance) for own in estimates),
        float(chi2.sf(spread, len(delays) - 1)),
    )


def _conditioned(own: BranchEstimate, delay: float, variance: float) -> BranchEstimate:
    """A branch given the delay of all."""
    i, c = own.delay, own.covariance
    if i is None or not c[i, i] > 0.0:
        return own
    g = c[:, i] / c[i, i]
    values = own.values - g * (own.values[i] - delay)
    covariance = c - np.outer(c[:, i], g) + variance * np.outer(g, g)
    return BranchEstimate(values, covariance, i)
