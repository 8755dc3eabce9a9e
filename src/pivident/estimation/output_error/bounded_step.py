"""A Gauss–Newton step within bounds, of the unknowns that the errors determine.

    H δ = g,   low ≤ p + δ ≤ high

Unknowns that a step would take past a bound go to it, and the others' step is solved anew with
these held, until none is left that passes one. Directions of H, scaled to a diagonal of ones,
whose eigenvalue is next to nothing are determined by nothing: what has the largest share in them is
held where it is.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

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
