"""Ridge regression, and estimates with a normal prior (MAP).

    θ = argmin ‖τ - Φθ‖² + (θ - θ₀)ᵀ K (θ - θ₀) = θ₀ + (ΦᵀΦ + K)⁻¹ Φᵀ(τ - Φθ₀)

rows weighted by 1/√λ_j. Ridge (Hoerl and Kennard 1970) has θ₀ = 0 and K = k diag(ΦᵀΦ)/N, with k
from generalised cross-validation (Golub, Heath and Wahba 1979),

    k = argmin N ‖τ - Φθ_k‖²/(N - tr Φ(ΦᵀΦ + K)⁻¹Φᵀ)²

It shrinks what the motion hardly tells; its standard errors do not contain the bias that it makes.

With a prior θ ~ N(θ₀, Σ₀), from CAD or an earlier estimate, K = Σ₀⁻¹, and the posterior is normal
with covariance (ΦᵀΦ + Σ₀⁻¹)⁻¹: an interval that contains the truth as often as it says where the
prior is true. A flat prior gives least squares.
"""

from __future__ import annotations

import numpy as np

from pivident.estimation.covariance import inverse_gram
from pivident.estimation.covariance.sandwich import jackknife_of
from pivident.estimation.normal_equations import JointSums
from pivident.estimation.regression.rows import NormalEquations, Rows, Solved

#: Range of k that is searched, and how many values.
RANGE, VALUES = (1e-10, 1e2), 241


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
    robust = _windows(sums, theta, penalty * np.diag(equations.scale**2), np.zeros(rows.size))
    condition = float(np.sqrt((values[-1] + penalty) / (values[0] + penalty)))
    return Solved(theta, covariance, robust, condition, theta[None]), penalty


def solve_with_prior(rows: Rows, mean: np.ndarray, precision: np.ndarray) -> Solved:
    """The estimate with a normal prior.

    Args:
        rows: the equations.
        mean: θ₀, shape (parameters,).
        precision: Σ₀⁻¹, shape (parameters, parameters); zero where nothing is known.
    """
    sums = rows.sums()
    equations = NormalEquations.of(sums, rows.size)
    scale = equations.scale
    gram = equations.gram + precision / np.outer(scale, scale)
    inverse = inverse_gram(gram) / np.outer(scale, scale)
    theta = inverse @ (equations.moment * scale + precision @ mean)
    robust = _windows(sums, theta, precision, mean)
    robust = robust + inverse @ precision @ inverse  # what the prior leaves open
    condition = float(np.sqrt(np.linalg.cond(gram)))
    return Solved(theta, inverse, robust, condition, theta[None])


def contradiction(rows: Rows, mean: np.ndarray, deviation: np.ndarray) -> np.ndarray:
    """How far data and prior are apart, in standard deviations of their difference, (parameters,).

    ``deviation``: of the prior; infinite where nothing is known, where the result is zero.
    """
    equations = NormalEquations.of(rows.sums(), rows.size)
    spread = np.sqrt(np.diag(equations.inverse) + deviation**2)
    return (equations.solution - mean) / spread


def _windows(
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
