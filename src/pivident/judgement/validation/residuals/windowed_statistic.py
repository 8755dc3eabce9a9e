"""Is a vector zero on average? Two statistics whose size holds for correlation within windows.

From a vector m and what each window of time adds to it, m_k, with w_k the window's share,

    Ŝ = Σ_k (m_k - w_k m)(m_k - w_k m)ᵀ / c

is its covariance. With twice as many windows as directions or more it is Hotelling's T²,

    F = mᵀ Ŝ⁻¹ m (K - d + 1)/(K d)        on d and K - d + 1 degrees of freedom.

With fewer the inverse would be worthless, and only a trace is divided by,

    F = mᵀ A⁻¹ m / tr(A⁻¹ Ŝ)              on ν and K ν,  ν = tr(A⁻¹S)²/tr((A⁻¹S)²)

where A is what the covariance would be for white residuals (Box 1954; Brunner, Dette and Munk
1997). Of Zᵀφ in a first stage the latter is the effective F of Montiel Olea and Pflueger (2013).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pivident.estimation.covariance.windows import OVERLAP
from pivident.foundation.distributions import fisher

#: Neighbouring windows overlap, and their sums are correlated: one window counts for less.
OVERLAPPING = 1.0 + 2.0 / 36.0

#: Windows for each direction from which on the inverse of the covariance is trusted.
WINDOWS_PER_DIRECTION = 2.0

#: Smallest eigenvalue of a Gram matrix of unit columns that counts as a direction.
SMALLEST = 1e-10


@dataclass(frozen=True)
class WindowedStatistic:
    """Outcome of the form."""

    statistic: float  # F
    directions: int  # number of directions of m
    #: Degrees of freedom of m and of its covariance, effective ones by the trace.
    degrees: tuple[float, float]
    p_value: float  # probability of a larger F where m is zero on average


def directions_of(gram: np.ndarray) -> np.ndarray:
    """L with Lᵀ A L = I on the directions that are there, shape (size, directions).

    ``gram``: A, shape (size, size).
    """
    scale = np.sqrt(np.maximum(np.diag(gram), 1e-300))
    values, vectors = np.linalg.eigh(gram / np.outer(scale, scale))
    kept = values > SMALLEST * max(values[-1], 1e-300)
    return vectors[:, kept] / np.sqrt(values[kept]) / scale[:, None]


def windowed_statistic(
    moment: np.ndarray,
    steps: np.ndarray,
    shares: np.ndarray,
    basis: np.ndarray,
    by_trace: bool | None = None,
) -> WindowedStatistic:
    """F of a vector and its windows.

    ``moment``: m, shape (size,); ``steps``: what each window adds to m, shape (windows, size);
    ``shares``: w_k, shape (windows,); ``by_trace``: whether only a trace is divided by; None: where
    windows are few.
    """
    value, directions = moment @ basis, basis.shape[1]
    centred = (steps - shares[:, None] * moment) @ basis
    windows = len(steps) / OVERLAPPING - 1.0
    centred *= np.sqrt((windows + 1.0) / (windows * OVERLAP))
    if not centred.any():
        return WindowedStatistic(0.0, directions, (float(directions), windows), 1.0)
    if by_trace is None:
        by_trace = windows < WINDOWS_PER_DIRECTION * directions
    form = _trace_form if by_trace else _hotelling
    statistic, degrees = form(value, centred, windows)
    return WindowedStatistic(statistic, directions, degrees, float(fisher.sf(statistic, *degrees)))


def _hotelling(
    value: np.ndarray, centred: np.ndarray, windows: float
) -> tuple[float, tuple[float, float]]:
    """F of T², with its degrees of freedom."""
    size = value.size
    freedom = windows - size + 1.0
    square = float(value @ np.linalg.lstsq(centred.T @ centred, value, rcond=1e-14)[0])
    return square * freedom / (windows * size), (float(size), freedom)


def _trace_form(
    value: np.ndarray, centred: np.ndarray, windows: float
) -> tuple[float, tuple[float, float]]:
    """F by the trace, with its degrees of freedom."""
    products = centred @ centred.T  # tr((A⁻¹Ŝ)²) is the sum of their squares
    trace, square = float(np.trace(products)), float(np.sum(products**2))
    degrees = _degrees(trace, square, windows, value.size)
    return float(value @ value) / trace, (degrees, degrees * windows)


def _degrees(trace: float, square: float, windows: float, most: int) -> float:
    """tr(S)²/tr(S²) from a covariance of few windows, freed of what their number adds."""
    both = (windows + 1.0) * (trace**2 - 2.0 * square / (windows + 1.0))
    degrees = both / max(windows * (square - trace**2 / windows), 1e-300)
    return float(np.clip(degrees, 1.0, most))
