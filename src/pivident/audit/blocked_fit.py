"""Least squares with intervals from a jackknife over stretches of time.

Neighbouring rows are not independent, so that formulas for white noise promise too much. One
stretch after the other is left out instead, and the scatter of the answers taken.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import lstsq
from scipy.special import ndtr, stdtrit

#: Stretches of time that a jackknife leaves out one by one.
BLOCKS = 20

#: Standard errors of such a jackknife that are as clear as four of a normal distribution.
CLEAR = float(stdtrit(BLOCKS - 1, ndtr(4.0)))

#: Columns whose remainder is smaller than this, relative to themselves, are combinations.
DEPENDENT = 1e-4


def orthonormal(columns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Orthonormal basis Q of some columns, and T with columns · T = Q."""
    length = np.linalg.norm(columns, axis=0)
    scale = 1.0 / np.where(length > 0, length, 1.0)
    # the triangle has the same singular values, and is as small as the number of columns
    _, s, vt = np.linalg.svd(np.linalg.qr(columns * scale, mode="r"), full_matrices=False)
    kept = s > DEPENDENT * s[0] if s.size else np.zeros(0, bool)
    back = (scale[:, None] * vt.T[:, kept]) / s[kept]
    return columns @ back, back


@dataclass(frozen=True, eq=False)
class BlockedFit:
    """A least squares fit with one replicate for each stretch of time left out."""

    estimate: np.ndarray  # coefficients, shape (columns,)
    replicates: np.ndarray  # without each block, shape (blocks, columns)

    def spread(self, of: np.ndarray | None = None) -> np.ndarray:
        """Jackknife standard errors of the coefficients, or of functions of them."""
        return jackknife(self.replicates if of is None else of)


def jackknife(replicates: np.ndarray) -> np.ndarray:
    """Deviation of a statistic from its values with one block left out, √((B-1)/B Σ (x - x̄)²)."""
    blocks = len(replicates)
    return np.sqrt((blocks - 1) * np.var(replicates, axis=0))


def blocked_fit(columns: np.ndarray, y: np.ndarray, block: np.ndarray) -> BlockedFit:
    """Ordinary least squares and its leave-one-block-out replicates, from normal equations."""
    present = np.unique(block)
    parts = [(columns[block == b], y[block == b]) for b in present]
    grams = [(a.T @ a, a.T @ b) for a, b in parts]
    gram, right = sum(g for g, _ in grams), sum(r for _, r in grams)

    def solve(g: np.ndarray, r: np.ndarray) -> np.ndarray:
        # LAPACK's default, by singular values, does not converge on some sound matrices
        return lstsq(g, r, cond=1e-12, lapack_driver="gelsy")[0]

    return BlockedFit(solve(gram, right), np.array([solve(gram - g, right - r) for g, r in grams]))
