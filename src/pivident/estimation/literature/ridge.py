"""Ridge regression: what the motion hardly tells is shrunk towards zero.

    θ = argmin ‖τ - Φθ‖² + θᵀ K θ = (ΦᵀΦ + K)⁻¹ Φᵀτ,   K = k diag(ΦᵀΦ)/N

rows weighted by 1/√λ_j (Hoerl and Kennard 1970), with k from generalised cross-validation (Golub,
Heath and Wahba 1979),

    k = argmin N ‖τ - Φθ_k‖²/(N - tr Φ(ΦᵀΦ + K)⁻¹Φᵀ)²

Its standard errors do not contain the bias that it makes.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from pivident.estimation.covariance.sandwich import jackknife_of
from pivident.estimation.literature.rows import NormalEquations, Noticed, Regression, Rows, Solved
from pivident.estimation.normal_equations import JointSums
from pivident.estimation.problem import Problem
from pivident.foundation.options import option
from pivident.foundation.text.finding import Finding, Quantity

#: Range of k that is searched, and how many values.
RANGE, VALUES = (1e-10, 1e2), 241


@dataclass(frozen=True, kw_only=True)
class Ridge(Regression):
    """Shrinks what the motion hardly tells towards zero.

    Attributes:
        penalty: k, in mean squares of the columns; None: by generalised cross-validation.
    """

    penalty: float | None = option(
        None,
        "in mean squares of the columns; not given: by generalised cross-validation",
        shown="see meaning", above=0.0,
    )  # fmt: skip

    label: ClassVar[str] = "IDIM-ridge"
    summary: ClassVar[str] = "shrinks what the motion hardly determines"

    def solve(self, problem: Problem, rows: Rows, start: np.ndarray) -> Noticed:
        """The estimate, and that its intervals lack the bias."""
        solved, penalty = solve_ridge(rows, self.penalty)
        return Noticed(solved, (_shrunk(penalty),))


def solve_ridge(rows: Rows, penalty: float | None) -> tuple[Solved, float]:
    """The estimate by ridge regression, and k.

    ``penalty``: k; None: by generalised cross-validation.
    """
    sums = rows.sums()
    equations = NormalEquations.of(sums, rows.size)
    values, vectors = np.linalg.eigh(equations.gram)
    moment = vectors.T @ equations.moment
    square = sum(own.tt for own in sums)

    def criterion(k: float) -> float:
        kept = values / (values + k)
        theta = moment / (values + k)
        error = square - 2.0 * theta @ moment + theta**2 @ values
        return error / (rows.count - kept.sum()) ** 2

    if penalty is None:
        grid = np.geomspace(*RANGE, VALUES)
        penalty = float(grid[np.argmin([criterion(k) for k in grid])])
    inverse = (vectors / (values + penalty)) @ vectors.T
    theta = inverse @ equations.moment / equations.scale
    outer = np.outer(equations.scale, equations.scale)
    covariance = inverse @ equations.gram @ inverse / outer
    robust = penalised_windows(
        sums, theta, penalty * np.diag(equations.scale**2), np.zeros(rows.size)
    )
    condition = float(np.sqrt((values[-1] + penalty) / (values[0] + penalty)))
    return Solved(theta, covariance, robust, condition, theta[None]), penalty


def penalised_windows(
    sums: list[JointSums], theta: np.ndarray, precision: np.ndarray, mean: np.ndarray
) -> np.ndarray:
    """Covariance of the data's part from windows of time; the penalty belongs to none of them."""
    count, size = len(sums[0].window_zf), theta.size
    gram, scores = np.zeros((count, size, size)), np.zeros((count, size))
    for own in sums:
        gram[:, own.columns[:, None], own.columns] += own.window_zf
        scores[:, own.columns] += own.window_zt - own.window_zf @ theta[own.columns]
    # at the estimate the scores sum up to K (θ - θ₀), which is none of the noise
    shares = np.einsum("kii->k", gram) / np.einsum("kii->", gram)
    scores -= np.outer(shares, precision @ (theta - mean))
    return jackknife_of(gram, scores, gram.sum(axis=0) + precision).covariance


def _shrunk(penalty: float) -> Finding:
    """What the intervals of ridge regression lack."""
    text = (
        f"Ridge regression shrinks parameters towards zero (penalty {penalty:.3g}); its intervals "
        "do not contain the bias that this makes."
    )
    return Finding(
        "warning", "regression", "shrunk", text, evidence={"penalty": Quantity(penalty, "")}
    )
