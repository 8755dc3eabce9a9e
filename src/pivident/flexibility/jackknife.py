"""Linear equations solved with instruments, and jackknife standard errors over blocks.

The estimate of y = Φθ + e with instruments Z is θ = (ZᵀΦ)⁻¹Zᵀy; without block b of n consecutive
ones it is θ_b. The standard error √((n-1)/n Σ (θ_b - mean θ_b)²) includes model error and needs no
model of e.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

#: Blocks of the jackknife, and the 97.5 % point of Student's t with one degree fewer.
BLOCKS, STUDENT = 10, 2.262


def solve_with_jackknife(
    phi: np.ndarray, z: np.ndarray, y: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """(ZᵀΦ)⁻¹Zᵀy of all samples, (parameters,), and without each block, (blocks, parameters)."""
    bounds = np.linspace(0, len(y), BLOCKS + 1).astype(int)
    parts = [slice(a, b) for a, b in pairwise(bounds)]
    scale = np.maximum(np.linalg.norm(phi, axis=0), 1e-300)
    phi, z = phi / scale, z / np.maximum(np.linalg.norm(z, axis=0), 1e-300)
    moments = np.array([z[p].T @ phi[p] for p in parts])
    right = np.array([z[p].T @ y[p] for p in parts])
    whole, all_right = moments.sum(axis=0), right.sum(axis=0)
    theta = np.linalg.lstsq(whole, all_right, rcond=1e-10)[0] / scale
    without = [
        np.linalg.lstsq(whole - m, all_right - r, rcond=1e-10)[0] / scale
        for m, r in zip(moments, right, strict=True)
    ]
    return theta, np.array(without)


def jackknife_standard_error(replicates: np.ndarray) -> float:
    """Standard error from the estimates without each block."""
    n = len(replicates)
    return float(np.sqrt((n - 1) / n * np.sum((replicates - replicates.mean()) ** 2)))
