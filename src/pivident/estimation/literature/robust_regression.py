"""Robust regression: squares of large errors count less (IRLS).

    θ = argmin Σ_j Σ_t ρ(u_jt),   u_jt = (τ_j - Φ_j θ)_t/s_j,   s_j the scale of joint j

ρ of Huber (1964) grows linearly beyond k = 1.345, that of Tukey's bisquare is constant beyond
k = 4.685; both are 95 % as efficient as least squares for normal errors. The minimum is that of
least squares with weights ψ(u)/u, made again until they settle (iteratively reweighted least
squares). s is the median of |τ - Φθ| over 0.6745, the normal one's. The covariance is Huber's
(1981, eq. 7.6.10),

    P = K² [Σ ψ(u)²/(N - p)]/[Σ ψ'(u)/N]² (ΦᵀΦ)⁻¹,   K = 1 + p var(ψ')/(N mean(ψ')²)

Against outliers of the torque: spikes, lost samples, a collision. Nothing against the bias of noise
in the observation matrix, or against a wrong model, which is no outlier.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np

from pivident.estimation.literature.rows import (
    IteratedRegression,
    NormalEquations,
    Noticed,
    Rows,
    Solved,
    windows_covariance,
)
from pivident.estimation.problem import Problem
from pivident.foundation.options import option
from pivident.foundation.text.finding import Finding, Quantity

Loss = Literal["huber", "bisquare"]

#: k of each loss.
TUNING = {"huber": 1.345, "bisquare": 4.685}

#: Median of the absolute values of a standard normal distribution.
NORMAL_MEDIAN = 0.6744897501960817

#: Passes with Huber's loss before the bisquare, whose minimum is not the only one.
CONVEX_PASSES = 5


@dataclass(frozen=True, kw_only=True)
class RobustRegression(IteratedRegression):
    """Squares of large errors count less, by iteratively reweighted least squares.

    Attributes:
        loss: ``huber``, which grows linearly, or ``bisquare``, which ends.
    """

    loss: Loss = option("huber", 'loss of large errors, or `"bisquare"`')

    label: ClassVar[str] = "IDIM-IRLS"
    summary: ClassVar[str] = "robust against spikes and lost samples"

    def solve(self, problem: Problem, rows: Rows, start: np.ndarray) -> Noticed:
        """The passes, and how many rows count less."""
        solved = solve_robust(rows, start, self.loss, self.tolerance, self.max_iterations)
        return Noticed(solved, _outliers(rows, solved.theta))


def weight(u: np.ndarray, loss: Loss) -> np.ndarray:
    """ψ(u)/u."""
    size, k = np.abs(u), TUNING[loss]
    if loss == "huber":
        return np.minimum(1.0, k / np.maximum(size, 1e-300))
    return np.where(size < k, (1.0 - (u / k) ** 2) ** 2, 0.0)


def slope(u: np.ndarray, loss: Loss) -> np.ndarray:
    """ψ'(u)."""
    size, k = np.abs(u), TUNING[loss]
    if loss == "huber":
        return (size <= k).astype(float)
    return np.where(size < k, (1.0 - (u / k) ** 2) * (1.0 - 5.0 * (u / k) ** 2), 0.0)


def scales(residuals: np.ndarray, used: np.ndarray) -> np.ndarray:
    """S of each joint from its errors, shape (joints,)."""
    found = [
        np.median(np.abs(own[part])) if part.any() else 1.0
        for own, part in zip(residuals, used, strict=True)
    ]
    return np.maximum(np.array(found) / NORMAL_MEDIAN, 1e-300)


def solve_robust(
    rows: Rows, start: np.ndarray, loss: Loss, tolerance: float, max_iterations: int
) -> Solved:
    """The estimate with a robust loss.

    Args:
        rows: the equations.
        start: where the passes begin, shape (parameters,).
        loss: ``huber`` or ``bisquare``.
        tolerance: change of all parameters, in standard errors, at which they end.
        max_iterations: give up after so many.
    """
    used = np.stack([own.used for own in rows.joints])
    theta, passes, converged = start, [], False
    for number in range(max_iterations):
        now: Loss = "huber" if number < CONVEX_PASSES else loss
        residuals = rows.residuals(theta)
        scale = scales(residuals, used)
        weights = weight(residuals / scale[:, None], now) / scale[:, None] ** 2
        sums = rows.sums(weights)
        equations = NormalEquations.of(sums, rows.size)
        change = np.abs(equations.solution - theta) / np.sqrt(np.diag(equations.inverse))
        theta = equations.solution
        passes.append(theta)
        converged = bool(change.max(initial=0.0) <= tolerance) and now == loss
        if converged:
            break
    u = rows.residuals(theta) / scale[:, None]
    covariance = _covariance(rows, u[used], scale, loss)
    robust = windows_covariance(sums, theta)
    return Solved(theta, covariance, robust, equations.condition, np.array(passes), converged)


def _covariance(rows: Rows, u: np.ndarray, scale: np.ndarray, loss: Loss) -> np.ndarray:
    """P; ``u``: the errors of all rows that count; ``scale``: s of each joint."""
    free = u.size - rows.size
    slopes, scores = slope(u, loss), u * weight(u, loss)
    correction = 1.0 + rows.size / u.size * np.var(slopes) / np.mean(slopes) ** 2
    factor = correction**2 * np.sum(scores**2) / free / np.mean(slopes) ** 2
    ones = np.ones((len(rows.joints), rows.joints[0].tau.size)) / scale[:, None] ** 2
    return factor * NormalEquations.of(rows.sums(ones), rows.size).inverse


def _outliers(rows: Rows, theta: np.ndarray) -> tuple[Finding, ...]:
    """How many rows lie beyond four scales: one in 16,000 of normal errors."""
    used = np.stack([own.used for own in rows.joints])
    residuals = rows.residuals(theta)
    beyond = (np.abs(residuals) > 4.0 * scales(residuals, used)[:, None]) & used
    share = float(100.0 * beyond.sum() / max(used.sum(), 1))
    if share < 0.1:
        return ()
    worst = int(np.argmax(beyond.sum(axis=1) / np.maximum(used.sum(axis=1), 1)))
    text = (
        f"{share:.2g} % of the rows have errors beyond four scales, most at joint "
        f"{rows.joints[worst].name}; they count less."
    )
    step = "Look at them in the residual plot: spikes are outliers, a pattern is a wrong model."
    evidence = {"rows beyond": Quantity(share, "%", bound=0.1)}
    where = rows.joints[worst].name
    return (Finding("note", "regression", "outliers", text, where, step, evidence),)
