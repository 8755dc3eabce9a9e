"""Maximum likelihood where the errors of the joints go together: a full covariance Λ of all.

    θ = (Σ_t Φ_tᵀ Λ⁻¹ Φ_t)⁻¹ Σ_t Φ_tᵀ Λ⁻¹ τ_t,   Λ = 1/N Σ_t e_t e_tᵀ,   e_t = τ_t - Φ_t θ

made in turns until they settle (seemingly unrelated regressions, Zellner 1962; iterated they
maximise the likelihood of normal errors). With Λ = diag(λ_j) it is weighted least squares. At a row
where joints do not count, those that do have their part of Λ. Covariance: (Σ_t Φ_tᵀ Λ⁻¹ Φ_t)⁻¹.

More precise than weighted least squares where one cause disturbs several joints at a time. Errors
have to be white in time, and noise in the observation matrix biases it as it does least squares.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from pivident.estimation.covariance import inverse_gram
from pivident.estimation.covariance.sandwich import jackknife_of
from pivident.estimation.covariance.windows import windows_of
from pivident.estimation.literature.rows import IteratedRegression, Noticed, Rows, Solved
from pivident.estimation.problem import Problem
from pivident.foundation.text.finding import Finding, Quantity

#: Smallest eigenvalue of the errors' correlation that noise of torques may have.
DEGENERATE = 0.02


@dataclass(frozen=True, kw_only=True)
class CorrelatedJoints(IteratedRegression):
    """Maximum likelihood with a full covariance between the errors of the joints."""

    label: ClassVar[str] = "IDIM-ML"
    summary: ClassVar[str] = "with the covariance between the joints"

    def solve(self, problem: Problem, rows: Rows, start: np.ndarray) -> Noticed:
        """The passes, and whether the errors are noise of the torques."""
        solved = solve_correlated(rows, start, self.tolerance, self.max_iterations)
        return Noticed(solved, _degenerate(rows, solved))


def solve_correlated(
    rows: Rows, start: np.ndarray, tolerance: float, max_iterations: int
) -> Solved:
    """The estimate with a full covariance between joints.

    Args:
        rows: the equations.
        start: where the passes begin, shape (parameters,).
        tolerance: change of all parameters, in standard errors, at which they end.
        max_iterations: give up after so many.
    """
    used = np.stack([own.used for own in rows.joints])
    theta, passes, converged = start, [], False
    for _ in range(max_iterations):
        gram, moment = _sums(rows, joint_covariance(rows.residuals(theta), used, rows.size), used)
        scale = np.sqrt(np.diag(gram.sum(axis=0)))
        outer = np.outer(scale, scale)
        whole = gram.sum(axis=0) / outer
        found = np.linalg.solve(whole, moment.sum(axis=0) / scale) / scale
        covariance = inverse_gram(whole) / outer
        change = np.abs(found - theta) / np.sqrt(np.diag(covariance))
        theta = found
        passes.append(theta)
        converged = bool(change.max(initial=0.0) <= tolerance)
        if converged:
            break
    robust = jackknife_of(gram, moment - gram @ theta, gram.sum(axis=0)).covariance
    condition = float(np.sqrt(np.linalg.cond(whole)))
    return Solved(theta, covariance, robust, condition, np.array(passes), converged)


def joint_covariance(residuals: np.ndarray, used: np.ndarray, size: int) -> np.ndarray:
    """Λ from the rows that both joints of a pair have, shape (joints, joints).

    ``residuals``: shape (joints, rows); ``size``: parameters, whose degrees of freedom the joints
    share.
    """
    count = used.astype(float)
    own = np.sqrt(np.maximum(np.diag(count @ count.T) - size / len(used), 1.0))
    noise = residuals * used
    spread = np.sqrt((noise**2).sum(axis=1)) / own
    lengths = np.sqrt((noise**2) @ count.T)  # of joint i over the rows of the pair
    correlation = noise @ noise.T / np.maximum(lengths * lengths.T, 1e-300)
    values, vectors = np.linalg.eigh(correlation)  # pairs with rows of their own: not definite
    correlation = (vectors * np.maximum(values, 1e-6)) @ vectors.T
    size_of = np.sqrt(np.diag(correlation))
    return correlation * np.outer(spread / size_of, spread / size_of)


def _sums(rows: Rows, noise: np.ndarray, used: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Σ ΦᵀΛ⁻¹Φ and Σ ΦᵀΛ⁻¹τ of each window of time."""
    windows = windows_of(rows.lengths)
    count = sum(own.count for own in windows)
    gram, moment = np.zeros((count, rows.size, rows.size)), np.zeros((count, rows.size))
    patterns, which = np.unique(used, axis=1, return_inverse=True)
    for k, pattern in enumerate(patterns.T):  # which joints count together, and on which rows
        active, where = np.flatnonzero(pattern), np.flatnonzero(which.ravel() == k)
        if not active.size:
            continue
        # Λ⁻¹ = Wᵀ W, so that rows W Φ have errors that are independent and of unit variance
        for line in np.linalg.inv(np.linalg.cholesky(noise[np.ix_(active, active)])):
            stack = np.zeros((rows.size + 1, where.size))
            for share, j in zip(line, active, strict=True):
                if share != 0.0:
                    own = rows.joints[j]
                    stack[own.columns] += share * own.phi[:, where]
                    stack[-1] += share * own.tau[where]
            _add(stack, where, rows, gram, moment)
    return gram, moment


def _add(
    stack: np.ndarray, where: np.ndarray, rows: Rows, gram: np.ndarray, moment: np.ndarray
) -> None:
    """Add rows to the windows that they lie in, each with its weight."""
    start = 0
    for window, length in zip(windows_of(rows.lengths), rows.lengths, strict=True):
        inside = (where >= start) & (where < start + length)
        at, own = where[inside] - start, stack[:, inside]
        for share in window.shares(slice(0, length)):
            part = slice(*np.searchsorted(at, (share.part.start, share.part.stop)).tolist())
            if part.start == part.stop:
                continue
            rising = share.rising[at[part] - share.part.start]
            for k, weights in ((share.window, 1.0 - rising), (share.window + 1, rising)):
                product = (own[:, part] * weights) @ own[:, part].T
                gram[k] += product[:-1, :-1]
                moment[k] += product[:-1, -1]
        start += length


def _degenerate(rows: Rows, made: Solved) -> tuple[Finding, ...]:
    """Whether some combination of joints is explained almost without error."""
    used = np.stack([own.used for own in rows.joints])
    noise = joint_covariance(rows.residuals(made.theta), used, rows.size)
    heard = used.any(axis=1)  # joints with an equation
    noise = noise[np.ix_(heard, heard)]
    size = np.sqrt(np.diag(noise))
    least = float(np.linalg.eigvalsh(noise / np.outer(size, size))[0])
    if least >= DEGENERATE:
        return ()
    text = (
        "A combination of the joints' torques is explained almost without error (share "
        f"{least:.2g} of theirs): the errors are not noise of the torques, and what is gained by "
        "their correlation is not precision."
    )
    step = "Take ls, or piv against noise of the positions."
    evidence = {"share": Quantity(least, "", bound=DEGENERATE)}
    return (Finding("warning", "regression", "degenerate", text, "", step, evidence),)
