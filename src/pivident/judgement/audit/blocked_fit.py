"""Least squares with intervals from a jackknife over stretches of time.

Neighbouring rows are not independent, so that formulas for white noise promise too much. One
stretch after the other is left out instead, and the scatter of the answers taken.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg import lstsq

from pivident.foundation.distributions import normal, student

#: Stretches of time that a jackknife leaves out one by one.
BLOCKS = 20

#: Standard errors of such a jackknife that are as clear as four of a normal distribution.
CLEAR = float(student.ppf(normal.cdf(4.0), BLOCKS - 1))

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

    grams: np.ndarray  # AᵀA of each block, shape (blocks, columns, columns)
    rights: np.ndarray  # Aᵀy of each block, shape (blocks, columns)

    @cached_property
    def estimate(self) -> np.ndarray:
        """Coefficients, shape (columns,)."""
        return _solved(self.grams.sum(axis=0), self.rights.sum(axis=0))

    @cached_property
    def replicates(self) -> np.ndarray:
        """Coefficients without each block, shape (blocks, columns)."""
        gram, right = self.grams.sum(axis=0), self.rights.sum(axis=0)
        parts = zip(self.grams, self.rights, strict=True)
        return np.array([_solved(gram - g, right - r) for g, r in parts])

    def spread(self, of: np.ndarray | None = None) -> np.ndarray:
        """Jackknife standard errors of the coefficients, or of functions of them."""
        return jackknife(self.replicates if of is None else of)


def _solved(gram: np.ndarray, right: np.ndarray) -> np.ndarray:
    # LAPACK's default, by singular values, does not converge on some sound matrices
    return np.asarray(lstsq(gram, right, cond=1e-12, lapack_driver="gelsy")[0])


def jackknife(replicates: np.ndarray) -> np.ndarray:
    """Deviation of a statistic from its values with one block left out, √((B-1)/B Σ (x - x̄)²)."""
    return np.sqrt((len(replicates) - 1) * np.var(replicates, axis=0))


def blocked_fit(columns: np.ndarray, y: np.ndarray, block: np.ndarray) -> BlockedFit:
    """Ordinary least squares and its leave-one-block-out replicates, from normal equations."""
    parts = [(columns[block == b], y[block == b]) for b in np.unique(block)]
    return BlockedFit(np.array([a.T @ a for a, _ in parts]), np.array([a.T @ b for a, b in parts]))
