"""Normal equations of the unknowns, the initial states of all stretches eliminated.

    H = Σ_s (H_pp - H_px H_xx⁻¹ H_xp),   g = Σ_s (g_p - H_px H_xx⁻¹ g_x)

with the blocks of JᵀL²J and JᵀL²e of stretch s, its unknowns p and its initial state x. This is
variable projection for the Gauss–Newton step: δ = H⁻¹ g, and δx = H_xx⁻¹ (g_x - H_xp δ) for each
stretch. Initial states have a normal prior around what the smoothed record says, so that a start
that the loop forgets at once cannot go astray.

The step stays within bounds, and is one of the unknowns that the errors determine:

    H δ = g,   low ≤ p + δ ≤ high

Unknowns that a step would take past a bound go to it, and the others' step is solved anew with
these held, until none is left that passes one. Directions of H, scaled to a diagonal of ones,
whose eigenvalue is next to nothing are determined by nothing: what has the largest share in them is
held where it is.
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


#: Eigenvalue of the scaled H, relative to the largest, below which nothing determines a direction:
#: the square of singular values of 1e-6.
UNDETERMINED = 1e-12

#: Share of an unknown in an undetermined direction from which on it is named.
NAMED_SHARE = 0.1

#: Rounds in which unknowns are held at bounds.
MAX_ROUNDS = 100


@dataclass(frozen=True, eq=False)
class BoundedStep:
    """One step."""

    step: np.ndarray  # δ, shape (unknowns,)
    bound: np.ndarray  # unknowns that a bound holds, shape (unknowns,)


def bounded_step(
    gram: np.ndarray,
    moment: np.ndarray,
    low: np.ndarray,
    high: np.ndarray,
    held: np.ndarray,
) -> BoundedStep:
    """Solve for δ with ``low`` ≤ δ ≤ ``high``; δ = 0 where ``held``, shape (unknowns,)."""
    step, bound = np.zeros(len(moment)), np.zeros(len(moment), bool)
    for _ in range(MAX_ROUNDS):
        free = np.flatnonzero(~held & ~bound)
        fixed = np.flatnonzero(bound)
        if not free.size:
            break
        right = moment[free] - gram[np.ix_(free, fixed)] @ step[fixed]
        own = gram[np.ix_(free, free)]
        scale = np.sqrt(np.maximum(np.diag(own), 1e-300))
        step[free] = np.linalg.solve(own / np.outer(scale, scale), right / scale) / scale
        beyond = free[(step[free] < low[free]) | (step[free] > high[free])]
        if not beyond.size:
            break
        step[beyond] = np.clip(step[beyond], low[beyond], high[beyond])
        bound[beyond] = True
    return BoundedStep(step, bound & ((step <= low) | (step >= high)))


def undetermined(gram: np.ndarray) -> list[np.ndarray]:
    """Unknowns that share each direction that nothing determines, the largest share first."""
    length = np.sqrt(np.maximum(np.diag(gram), 0.0))
    empty = length <= 0.0
    scale = np.where(empty, 1.0, length)
    values, vectors = np.linalg.eigh(gram / np.outer(scale, scale))
    groups = [np.array([i]) for i in np.flatnonzero(empty)]
    for k in np.flatnonzero(values <= UNDETERMINED * max(values[-1], 1e-300)):
        share = np.where(empty, 0.0, np.abs(vectors[:, k]))
        members = np.argsort(-share)[: np.count_nonzero(share > NAMED_SHARE)]
        if members.size:
            groups.append(members)
    return groups


def to_hold(gram: np.ndarray, held: np.ndarray, rather: np.ndarray) -> np.ndarray:
    """Which unknowns to hold so that the errors determine all others, shape (unknowns,).

    ``held``: those that are held already; ``rather``: those that are held before others of the same
    direction.
    """
    held = held.copy()
    while not held.all():
        free = np.flatnonzero(~held)
        groups = undetermined(gram[np.ix_(free, free)])
        if not groups:
            break
        members = free[groups[0]]
        preferred = members[rather[members]]
        held[preferred[0] if preferred.size else members[0]] = True
    return held


def condition_of(gram: np.ndarray) -> tuple[float, np.ndarray]:
    """Condition number of the scaled columns, and each unknown's share in their weakest direction.

    Result: the number, and shares, shape (unknowns,).
    """
    scale = np.sqrt(np.maximum(np.diag(gram), 1e-300))
    values, vectors = np.linalg.eigh(gram / np.outer(scale, scale))
    return float(np.sqrt(values[-1] / max(values[0], 1e-300))), np.abs(vectors[:, 0])
