"""Total least squares: errors in the observation matrix, too.

    minimise ‖[ΔΦ Δτ]‖²   subject to   (Φ + ΔΦ) θ = τ + Δτ

The solution is the right singular vector of [Φ τ] that belongs to the smallest singular value σ
(Golub and Van Loan 1980),

    θ = -v_1…p/v_p+1,   (ΦᵀΦ - σ² 1) θ = Φᵀτ

Rows are weighted by 1/√λ_j, columns and torque have unit length: errors are taken as equally large
relative to each column. That is the assumption of the method. Errors of an observation matrix come
from noise of positions through derivatives and squares; they are not alike in all columns, not
independent of each other, and structural zeros have none, so that the bias of least squares is
mended in part or over-mended. Covariance for independent errors (Van Huffel and Vandewalle 1991,
section 8.5), with A = ΦᵀΦ and N rows,

    P = σ²/N (1 + ‖θ‖²) (A - σ² 1)⁻¹ A (A - σ² 1)⁻¹
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from pivident.estimation.covariance.sandwich import jackknife_of
from pivident.estimation.literature.rows import Noticed, Regression, Rows, Solved
from pivident.estimation.problem import Problem
from pivident.foundation.errors import IdentificationError
from pivident.foundation.text.finding import Finding

#: Smallest last component of the singular vector: without it torque has no part in the relation.
NONGENERIC = 1e-8


_EQUAL_ERRORS = Finding(
    "note", "regression", "equal errors",
    "Total least squares takes errors as equally large in all columns, relative to their size; "
    "those of derivatives of measured positions are not, so that its bias may be smaller or larger "
    "than that of least squares.",
)  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class TotalLeastSquares(Regression):
    """Errors in the observation matrix, too, equally large in all columns."""

    label: ClassVar[str] = "IDIM-TLS"
    summary: ClassVar[str] = "total least squares"

    def solve(self, problem: Problem, rows: Rows, start: np.ndarray) -> Noticed:
        """The singular vector, and that its errors are equally large."""
        return Noticed(solve_total(rows), (_EQUAL_ERRORS,))


def solve_total(rows: Rows) -> Solved:
    """The estimate by total least squares.

    Raises:
        IdentificationError: the smallest singular vector has no part of the torque: the columns
            depend on each other more than the torque does on them.
    """
    triangle, size = rows.triangle(), rows.size
    scale = np.linalg.norm(triangle, axis=0)
    scale[scale == 0.0] = 1.0
    values, vectors = np.linalg.svd(triangle / scale)[1:]
    last = vectors[-1]
    if abs(last[size]) < NONGENERIC:
        raise IdentificationError(
            "total least squares has no solution: the columns of the observation matrix depend "
            "on each other more than the torque does on them",
            advice="leave out parameters, or use ls",
        )
    scaled = -last[:size] / last[size]
    square = values[-1] ** 2
    columns = triangle[:, :size] / scale[:size]
    gram = columns.T @ columns
    inverse = np.linalg.inv(gram - square * np.eye(size))
    to_own = scale[size] / scale[:size]
    factor = square / rows.count * (1.0 + scaled @ scaled)
    covariance = factor * inverse @ gram @ inverse * np.outer(to_own, to_own)
    theta = scaled * to_own
    robust = _windows(rows, theta, square, scale)
    return Solved(theta, covariance, robust, float(np.linalg.cond(columns)), theta[None])


def _windows(rows: Rows, theta: np.ndarray, square: float, scale: np.ndarray) -> np.ndarray:
    """Covariance from windows of time, of which each has its share of σ²."""
    size = rows.size
    sums = rows.sums()
    count = len(sums[0].window_zf)
    gram, moment = np.zeros((count, size, size)), np.zeros((count, size))
    for own in sums:
        gram[:, own.columns[:, None], own.columns] += own.window_zf
        moment[:, own.columns] += own.window_zt
    gram -= square / count * np.diag(scale[:size] ** 2)
    return jackknife_of(gram, moment - gram @ theta, gram.sum(axis=0)).covariance
