"""Covariance that holds for residuals that are not white: a sandwich over smooth windows.

    P = Σ_k (θ₍ₖ₎ - θ)(θ₍ₖ₎ - θ)ᵀ / c,    θ₍ₖ₎ - θ = -(ZᵀΦ - Z_kᵀΦ)⁻¹ Z_kᵀε

θ₍ₖ₎ is the estimate without window k (a jackknife, in its linear form, which frees the residuals
of the share that the estimate itself took from them). Within a window any correlation and any
change of the variance is allowed; windows are longer than the correlation.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pivident.estimation.covariance.windows import OVERLAP
from pivident.estimation.normal_equations import JointSums


def sandwich(
    sums: Sequence[JointSums],
    theta: np.ndarray,
    variance: np.ndarray,
    weight_power: float = 1.0,
) -> np.ndarray:
    """Covariance of the estimate, shape (parameters, parameters)."""
    count, size = len(sums[0].window_zf), theta.size
    zf, scores = np.zeros((count, size, size)), np.zeros((count, size))
    for joint, lam in zip(sums, np.asarray(variance) ** weight_power, strict=True):
        own = joint.columns
        zf[:, own[:, None], own] += joint.window_zf / lam
        scores[:, own] += (joint.window_zt - joint.window_zf @ theta[own]) / lam
    total = zf.sum(axis=0)
    # columns of unit length: parameters differ by orders of magnitude
    scale = np.sqrt(np.maximum(np.abs(np.diag(total)), 1e-300))
    without = (total - zf) / np.outer(scale, scale)
    steps = np.linalg.solve(without, (scores / scale)[:, :, None])[:, :, 0] / scale
    return steps.T @ steps / OVERLAP
