"""Normal equations of the unknowns, the initial states of all stretches eliminated.

    H = Σ_s (H_pp - H_px H_xx⁻¹ H_xp),   g = Σ_s (g_p - H_px H_xx⁻¹ g_x)

with the blocks of JᵀL²J and JᵀL²e of stretch s, its unknowns p and its initial state x. This is
variable projection for the Gauss–Newton step: δ = H⁻¹ g, and δx = H_xx⁻¹ (g_x - H_xp δ) for each
stretch. Initial states have a normal prior around what the smoothed record says, so that a start
that the loop forgets at once cannot go astray.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pivident.estimation.covariance.sandwich import Jackknife, jackknife_of
from pivident.estimation.normal_equations import JointSums


@dataclass(frozen=True, eq=False)
class StretchEquations:
    """Blocks of one stretch, weighted by 1/λ."""

    gram: np.ndarray  # JᵀL²J with the prior, shape (unknowns + starts,) twice
    moment: np.ndarray  # JᵀL²e with that of the prior, shape (unknowns + starts,)
    window_gram: np.ndarray  # JᵀL²J of each window of time
    window_moment: np.ndarray  # JᵀL²e likewise
    unknowns: int  # how many of the columns come first

    @property
    def elimination(self) -> np.ndarray:
        """H_xx⁻¹ H_xp, shape (starts, unknowns)."""
        p = self.unknowns
        return np.linalg.solve(self.gram[p:, p:], self.gram[p:, :p])

    def start_step(self, step: np.ndarray) -> np.ndarray:
        """δx that belongs to a step of the unknowns, shape (starts,)."""
        p = self.unknowns
        if len(self.moment) == p:
            return np.zeros(0)
        return np.linalg.solve(self.gram[p:, p:], self.moment[p:] - self.gram[p:, :p] @ step)


@dataclass(frozen=True, eq=False)
class ReducedEquations:
    """H and g of the unknowns."""

    gram: np.ndarray  # H, shape (unknowns, unknowns)
    moment: np.ndarray  # g, shape (unknowns,)
    stretches: tuple[StretchEquations, ...]

    @classmethod
    def of(cls, stretches: Sequence[StretchEquations]) -> ReducedEquations:
        """Eliminate the initial states."""
        p = stretches[0].unknowns
        gram, moment = np.zeros((p, p)), np.zeros(p)
        for own in stretches:
            gram += own.gram[:p, :p]
            moment += own.moment[:p]
            if len(own.moment) > p:
                solved = own.elimination
                gram -= own.gram[:p, p:] @ solved
                moment -= solved.T @ own.moment[p:]
        return cls(0.5 * (gram + gram.T), moment, tuple(stretches))

    def gain(self, step: np.ndarray) -> float:
        """By how much a step, with those of the initial states, makes the squares smaller."""
        gain = 0.0
        for own in self.stretches:
            whole = np.concatenate([step, own.start_step(step)])
            gain += float(2.0 * own.moment @ whole - whole @ own.gram @ whole)
        return gain

    def damped(self, damping: float) -> ReducedEquations:
        """With (1 + μ) times the diagonals, initial states included, for shorter steps."""
        return ReducedEquations.of(
            [
                replace(own, gram=own.gram + damping * np.diag(np.diag(own.gram)))
                for own in self.stretches
            ]
        )

    def scores_without(self, step: np.ndarray, kept: np.ndarray) -> Jackknife:
        """Windows of time, of the unknowns ``kept`` alone, after a step of all of them.

        The columns of a window, too, are those that the elimination leaves.
        """
        p = len(self.moment)
        grams, moments = [], []
        for own in self.stretches:
            whole = np.concatenate([step, own.start_step(step)])
            moment = own.window_moment - own.window_gram @ whole
            gram = own.window_gram
            if len(own.moment) > p:
                project = np.vstack([np.eye(p), -own.elimination])
                moment = moment @ project
                gram = project.T @ gram @ project
            grams.append(gram[:, kept][:, :, kept])
            moments.append(moment[:, kept])
        total = self.gram[np.ix_(kept, kept)]
        return jackknife_of(np.concatenate(grams), np.concatenate(moments), total)


def stretch_equations(
    sums: Sequence[Sequence[JointSums]],
    variance: np.ndarray,
    unknowns: int,
    start_std: np.ndarray | None,
    moved: np.ndarray,
) -> StretchEquations:
    """The blocks of one stretch.

    ``sums``: of each channel and joint; ``variance``: λ of them, shape (channels, joints);
    ``start_std``: of the prior of the initial state; ``moved``: how far the initial state is from
    the middle of that prior, shape (starts,).
    """
    size, count = len(sums[0][0].columns), len(sums[0][0].window_zf)
    gram, moment = np.zeros((size, size)), np.zeros(size)
    window_gram, window_moment = np.zeros((count, size, size)), np.zeros((count, size))
    for own, lambdas in zip(sums, variance, strict=True):
        for joint, lam in zip(own, lambdas, strict=True):
            gram += joint.zf / lam
            moment += joint.zt / lam
            window_gram += joint.window_zf / lam
            window_moment += joint.window_zt / lam
    if start_std is not None:
        information = 1.0 / start_std**2
        gram[unknowns:, unknowns:] += np.diag(information)
        moment[unknowns:] -= information * moved
    return StretchEquations(gram, moment, window_gram, window_moment, unknowns)


def error_variances(
    sums: Sequence[Sequence[Sequence[JointSums]]], steps: Sequence[np.ndarray], free: float
) -> np.ndarray:
    """λ of each channel and joint after a step, shape (channels, joints).

    ``steps``: of the unknowns and the initial state, for each stretch; ``free``: degrees of freedom
    that all unknowns take together, shared out evenly over the rows.
    """
    channels, joints = len(sums[0]), len(sums[0][0])
    squares, totals, rows = np.zeros((3, channels, joints))
    for own, step in zip(sums, steps, strict=True):
        for c in range(channels):
            for j in range(joints):
                squares[c, j] += own[c][j].residual_sum(step)
                totals[c, j] += own[c][j].tt
                rows[c, j] += own[c][j].rows
    left = np.maximum(rows * (1.0 - free / max(rows.sum(), 1.0)), 1.0)
    return np.maximum(squares, 1e-24 * np.maximum(totals, 1e-300)) / left
