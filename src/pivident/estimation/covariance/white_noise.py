"""Covariance of an estimate whose filtered residual is white noise, (P-31)."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from pivident.estimation.covariance import inverse_gram


def white_noise_covariance(
    squares: Iterable[tuple[np.ndarray, np.ndarray]],
    variance: Sequence[float] | np.ndarray,
    scale: np.ndarray,
) -> np.ndarray:
    """(Σ_j Z_jᵀ Z_j/λ_j)⁻¹ (P-31), solved in units in which the columns are of equal size.

    ``squares``: columns of each joint and its ZᵀZ; ``variance``: λ; ``scale``: product of the
    columns' sizes, (parameters, parameters).
    """
    total = np.zeros_like(scale)
    for (columns, own), lam in zip(squares, variance, strict=True):
        total[np.ix_(columns, columns)] += own / lam
    return inverse_gram(total / scale) / scale
