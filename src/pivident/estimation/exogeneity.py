"""Durbin, Wu and Hausman: do the regressors carry noise that the instruments do not?

The whitened equations are fitted once by least squares on Φ and once with what the instruments
leave of Φ beside it (Janot, Vandanjon and Gautier 2016),

    τ = Φ θ + V δ + e,   V = Φ - Z (ZᵀZ)⁻¹ ZᵀΦ,    F = [(RSS₀ - RSS₁)/d] / [RSS₁/(n - b - d)]  (E2)

with d the directions of V that are left beside Φ. δ = 0 says that least squares would do as well.
F supposes white residuals. Those of real records are correlated by model error, and F rejects
nearly always; ``validation.overidentification`` has the form that holds its size for them.
A reconstructed reference that follows the noise of the record hides from this test, which is why
its freedom is reported with it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pivident.estimation.normal_equations import JointSums

#: Smallest eigenvalue, of the Gram matrix of unit columns, of a direction that counts.
SMALLEST = 1e-10


@dataclass(frozen=True)
class ExogeneityTest:
    """The test's outcome."""

    statistic: float  # F
    directions: int  # d
    rows: int  # n
    p_value: float  # probability of a larger F where the regressors are exogenous

    def __str__(self) -> str:
        verdict = (
            "the regressors contain noise that the instruments do not, so least squares would "
            "be biased"
            if self.p_value < 0.05
            else "regressors and instruments agree, and least squares would do as well"
        )
        return (
            f"Exogeneity (Durbin-Wu-Hausman, for a white residual): F = {self.statistic:.3g} on "
            f"{self.directions} and {self.rows} degrees of freedom, p = {self.p_value:.2g}: "
            f"{verdict}."
        )


def durbin_wu_hausman(sums: Sequence[JointSums], variance: np.ndarray, size: int) -> ExogeneityTest:
    """Test on the normal equations of all joints, whose columns are whitened."""
    from scipy.special import fdtrc  # scipy.stats takes half a second to import

    gram, right = np.zeros((2 * size, 2 * size)), np.zeros(2 * size)
    total, rows = 0.0, 0
    for joint, lam in zip(sums, variance, strict=True):
        both = np.r_[joint.columns, size + joint.columns]
        block = np.block([[joint.ff, joint.zf.T], [joint.zf, joint.zz]])
        gram[np.ix_(both, both)] += block / lam
        right[both] += np.r_[joint.ft, joint.zt] / lam
        total += joint.tt / lam
        rows += joint.rows
    scale = np.sqrt(np.maximum(np.diag(gram), 1e-300))
    gram, right = gram / np.outer(scale, scale), right / scale
    explained, rank = _explained(gram[:size, :size], right[:size])
    more, larger_rank = _explained(gram, right)
    directions = max(larger_rank - rank, 1)
    freedom = max(rows - larger_rank, 1)
    statistic = max(more - explained, 0.0) / directions / max((total - more) / freedom, 1e-300)
    return ExogeneityTest(
        float(statistic),
        directions,
        freedom,
        float(fdtrc(directions, freedom, statistic)),
    )


def _explained(gram: np.ndarray, right: np.ndarray) -> tuple[float, int]:
    """Sum of squares that the columns explain, and their numerical rank."""
    values, vectors = np.linalg.eigh(gram)
    kept = values > SMALLEST * values[-1]
    shares = (vectors.T @ right)[kept] ** 2 / values[kept]
    return float(shares.sum()), int(kept.sum())
