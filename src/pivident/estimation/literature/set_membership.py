"""Set membership: all parameters that explain each row within a bound of its error.

    |τ_j - Φ_j θ| ≤ ε_j   on all rows   →   min θ_i ≤ θ_i ≤ max θ_i,  two linear programs for each i

(Milanese and Belforte 1982; Walter and Piet-Lahanier 1990). Nothing is assumed of the error but its
bound: it may be a bias, a wrong model or an adversary. Where the bound is true, so are all
intervals, together and without a probability. The estimate is the middle of each interval.

The programs have few rows that matter. They are solved on some, those that the solution violates
are added, until there are none. The next program begins with the rows that have determined a
solution so far, a fiftieth of all, and where the last one ended.

Without a bound, ε_j is the largest error that least squares leaves on joint j, times ``MARGIN``, so
that its estimate is inside: a statement about these rows, no guarantee.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from scipy.linalg import qr

from pivident.estimation.literature.boxed_program import (
    Basis,
    basis_of,
    lower_bound,
    minimise,
)
from pivident.estimation.literature.rows import NormalEquations, Noticed, Regression, Rows, Solved
from pivident.estimation.problem import Problem
from pivident.foundation.errors import IdentificationError
from pivident.foundation.options import option, per_joint
from pivident.foundation.text.finding import Finding, Quantity

#: Rows that are added at a time, the worst of each joint.
ADDED = 10

#: Rows of each joint, over its parameters, among which those of the first basis are chosen.
SPREAD = 20

#: Violation, in bounds, that is none.
SLACK = 1e-9

#: Eigenvalue of the normal equations, over the largest, of a direction that no row sees, and the
#: share of it in a parameter that has no interval.
UNSEEN, UNBOUNDED = 1e-13, 1e-6

#: Bounds without a word of the user, over the largest errors of least squares.
MARGIN = 1.1


@dataclass(frozen=True, kw_only=True)
class SetMembership(Regression):
    """Intervals that are guaranteed where each row's error keeps to its bound.

    Attributes:
        bound: bound of the torque's error of all joints, or of each [N m or N]; None: the
            largest that least squares leaves, and a tenth: no guarantee then.
    """

    bound: float | tuple[float, ...] | None = option(
        None,
        "bound of the torque's error, of all joints or of each; not given: the largest that least "
        "squares leaves, and a tenth",
        unit="N m or N", kind="number or list", shown="see meaning", above=0.0,
    )  # fmt: skip

    label: ClassVar[str] = "set membership"
    summary: ClassVar[str] = "guaranteed intervals for bounded errors"

    def solve(self, problem: Problem, rows: Rows, start: np.ndarray) -> Noticed:
        """Intervals by bounded errors: two standard deviations to each side of the middle."""
        bound = None
        if self.bound is not None:
            bound = per_joint("bound", self.bound, len(rows.joints))
        box = parameter_box(rows, bound, start)
        theta, half = 0.5 * (box.low + box.high), 0.5 * (box.high - box.low)
        covariance = np.diag((0.5 * half) ** 2)
        condition = NormalEquations.of(rows.sums(), rows.size).condition
        solved = Solved(theta, covariance, covariance, condition, theta[None])
        return Noticed(solved, (_bounded(rows, box) if bound is None else _GUARANTEED,))


_GUARANTEED = Finding(
    "note", "regression", "bounded errors",
    "The intervals, two standard deviations to each side, contain the truth for certain if the "
    "model is right and no error of a filtered row is beyond its bound.",
)  # fmt: skip


def _bounded(rows: Rows, box: ParameterBox) -> Finding:
    """That nobody has given the bounds."""
    text = (
        "No bound of the torque's error was given: the largest error that least squares leaves was "
        "taken, and a tenth more. Its intervals are no guarantee."
    )
    step = "Give bound, the largest error that sensor and model can make."
    evidence = {
        f"bound of {joint.name}": Quantity(float(value), "N m or N")
        for joint, value in zip(rows.joints, box.bound, strict=True)
    }
    return Finding("warning", "regression", "bound from record", text, "", step, evidence)


@dataclass(frozen=True, eq=False)
class ParameterBox:
    """Intervals of all parameters.

    Attributes:
        low: their lower ends, shape (parameters,).
        high: their upper ends, likewise.
        bound: ε of each joint, shape (joints,) [N m or N].
    """

    low: np.ndarray
    high: np.ndarray
    bound: np.ndarray


def parameter_box(rows: Rows, bound: np.ndarray | None, start: np.ndarray) -> ParameterBox:
    """Intervals that hold where errors keep to their bound.

    Args:
        rows: the equations, weighted by 1/√λ_j.
        bound: ε of each joint, shape (joints,) [N m or N]; None: from the errors of ``start``.
        start: parameters near the middle, shape (parameters,).

    Raises:
        IdentificationError: no parameters keep to the bound; names the joint and the row that
            contradict most.
    """
    if bound is None:
        largest = np.abs(rows.residuals(start)).max(axis=1)
        bound = MARGIN * np.maximum(largest, SLACK * largest.max()) * rows.root
    program = _Program(rows, np.asarray(bound, float) / rows.root)
    share = np.abs(rows.residuals(start)) / program.relative[:, None]
    if share.max() > 1.0 and (least := program.least(start)) > 1.0 + SLACK:
        raise _contradiction(rows, program, bound, least)
    low, high = np.empty((2, rows.size))
    for i in range(rows.size):
        low[i], high[i] = program.extreme(i, 1.0), program.extreme(i, -1.0)
    return ParameterBox(low, high, program.relative * rows.root)


def _contradiction(
    rows: Rows, program: _Program, bound: np.ndarray, least: float
) -> IdentificationError:
    """Which joint and row no parameters explain."""
    joint, row = program.worst
    own = rows.joints[joint]
    return IdentificationError(
        f"no parameters explain all rows within the bounds: they would have to be {least:.3g} "
        f"times as wide. Worst is joint {own.name!r} at row {row} (bound {bound[joint]:.4g})",
        advice="widen its bound, leave the row out, or look for what the model lacks there",
    )


class _Program:
    """Linear programs over rows that matter, in columns of unit length."""

    def __init__(self, rows: Rows, relative: np.ndarray) -> None:
        self.rows = rows
        #: ε_j/√λ_j, shape (joints,).
        self.relative = relative
        gram = np.zeros((rows.size, rows.size))
        for own in rows.joints:
            gram[np.ix_(own.columns, own.columns)] += own.phi @ own.phi.T
        length = np.sqrt(np.diag(gram) / max(rows.count, 1))
        self.scale = np.where(length > 0.0, length, 1.0)
        size, directions = np.linalg.eigh(gram / np.outer(self.scale, self.scale))
        #: Directions that no row sees, shape (directions, parameters). Rows of their own hold them;
        #: the intervals of the others do not depend on where.
        self.unseen = directions[:, size <= UNSEEN * size[-1]].T
        #: Joint and row of each row that is known to matter, and its Φ, τ and ε.
        self.known = [(-1, k) for k in range(len(self.unseen))]
        self.phi, self.tau = self.unseen.copy(), np.zeros(len(self.unseen))
        self.bound = np.ones(len(self.unseen))
        self.basis = self._first_basis()
        #: Numbers of those that every program begins with.
        self.lasting = set(self.basis.rows.tolist())
        #: Joint and row on which the least m rests most: it would fall fastest if this bound were
        #: wider.
        self.worst = (0, 0)

    def least(self, start: np.ndarray) -> float:
        """The smallest m with |τ - Φθ| ≤ m ε on all rows (Chebyshev's approximation)."""
        from scipy.optimize import linprog

        size = self.rows.size
        cost = np.append(np.zeros(size), 1.0)
        free = [(None, None)] * size + [(0.0, None)]
        self._forget()
        self._add(start, 0.0)
        while True:
            phi, tau, bound = self.phi, self.tau, self.bound[:, None]
            upper = np.block([[phi, -bound], [-phi, -bound]])
            made = linprog(cost, upper, np.concatenate([tau, -tau]), bounds=free)
            if made.x is None:
                raise IdentificationError(f"a linear program failed: {made.message}")
            prices = np.abs(made.ineqlin.marginals.reshape(2, -1)).max(axis=0)
            self.worst = self.known[int(np.argmax(prices))]
            if not self._add(made.x[:size] / self.scale, float(made.x[size])):
                return float(made.x[size])

    def extreme(self, i: int, sign: float) -> float:
        """Smallest (sign 1) or largest (sign -1) value of parameter i."""
        if (np.abs(self.unseen[:, i]) > UNBOUNDED).any():
            return -sign * np.inf
        cost = np.zeros(self.rows.size)
        cost[i] = sign
        self._forget()
        while True:
            if not minimise(self.phi, self.tau, self.bound, cost, self.basis):
                raise IdentificationError(
                    "a linear program failed: its rows are too nearly dependent",
                    advice="leave out parameters that the motion hardly excites",
                )
            if not self._add(self.basis.theta / self.scale):
                self.lasting |= set(self.basis.rows.tolist())
                return sign * lower_bound(self.tau, self.bound, self.basis) / float(self.scale[i])

    def _first_basis(self) -> Basis:
        """Independent rows, of some that are spread over the record, or else of all."""
        for spread in (SPREAD, None):
            for j, own in enumerate(self.rows.joints):
                used = np.flatnonzero(own.used)
                step = len(used) // (spread * len(own.columns)) if spread else 1
                self._take(j, used[:: max(step, 1)])
            triangle, order = qr(self.phi.T, mode="r", pivoting=True)
            if np.abs(triangle[-1, self.rows.size - 1]) > UNBOUNDED * np.abs(triangle[0, 0]):
                break
        return basis_of(order[: self.rows.size])

    def _forget(self) -> None:
        """Leave rows that never determined a solution."""
        kept = np.array(sorted(self.lasting))
        number = np.full(len(self.known), -1)
        number[kept] = np.arange(len(kept))
        self.basis.rows[:] = number[self.basis.rows]
        self.known = [self.known[k] for k in kept.tolist()]
        self.phi, self.tau, self.bound = self.phi[kept], self.tau[kept], self.bound[kept]
        self.lasting = set(range(len(kept)))

    def _add(self, theta: np.ndarray, factor: float = 1.0) -> bool:
        """Add the rows that θ violates most; whether there were any."""
        size = np.abs(self.rows.residuals(theta)) / self.relative[:, None]
        before = len(self.known)
        for j, own in enumerate(size):
            beyond = np.flatnonzero(own > factor * (1.0 + SLACK))
            self._take(j, beyond[np.argsort(own[beyond])[: -ADDED - 1 : -1]])
        return len(self.known) > before

    def _take(self, joint: int, numbers: np.ndarray) -> None:
        """Φ in scaled columns, τ and ε of rows of a joint, those that are not known."""
        known, own = set(self.known), self.rows.joints[joint]
        new = [row for row in numbers.tolist() if (joint, row) not in known]
        phi = np.zeros((len(new), self.rows.size))
        phi[:, own.columns] = (own.phi[:, new] / self.scale[own.columns, None]).T
        self.known += [(joint, row) for row in new]
        self.phi, self.tau = np.vstack([self.phi, phi]), np.append(self.tau, own.tau[new])
        self.bound = np.append(self.bound, np.full(len(new), self.relative[joint]))
