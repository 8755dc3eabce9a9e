"""Set membership: all parameters that explain each row within a bound of its error.

    |τ_j - Φ_j θ| ≤ ε_j   on all rows   →   min θ_i ≤ θ_i ≤ max θ_i,  two linear programs for each i

(Milanese and Belforte 1982; Walter and Piet-Lahanier 1990). Nothing is assumed of the error but its
bound: it may be a bias, a wrong model or an adversary. Where the bound is true, so are all
intervals, together and without a probability. The estimate is the middle of each interval.

The programs have few rows that matter. They are solved on some, those that the solution violates
are added, until there are none. The next program begins with the rows that have bound a solution
so far: a tenth of those that were added.

Without a bound, ε_j is the largest error that least squares leaves on joint j, times ``MARGIN``, so
that its estimate is inside: a statement about these rows, no guarantee.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pivident.errors import IdentificationError
from pivident.estimation.regression.rows import Rows

#: Rows that are added at a time, the worst of each joint.
ADDED = 40

#: Violation, in bounds, that is none.
SLACK = 1e-9

#: Distance from the bound, over the bound, of an error that is at it.
AT_BOUND = 1e-6

#: Answers of the solver to a program without a least value; that there are parameters is known.
_UNBOUNDED = (3, 4)

#: Bounds without a word of the user, over the largest errors of least squares.
MARGIN = 1.1


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
    program = _Program(rows, np.asarray(bound, float) / rows.root, start)
    least = program.least()
    if least > 1.0 + SLACK:
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
        f"times as wide. Worst is joint {own.name!r} at row {row} (bound {bound[joint]:.4g}); "
        "widen its bound, leave the row out, or look for what the model lacks there"
    )


class _Program:
    """Linear programs over rows that matter, in columns of unit length."""

    def __init__(self, rows: Rows, relative: np.ndarray, start: np.ndarray) -> None:
        self.rows = rows
        #: ε_j/√λ_j, shape (joints,).
        self.relative = relative
        squares = np.zeros(rows.size)
        for own in rows.joints:
            squares[own.columns] += (own.phi**2).sum(axis=1)
        self.scale = np.where(squares > 0.0, np.sqrt(squares / max(rows.count, 1)), 1.0)
        self.active: list[tuple[int, int]] = []
        self.known: set[tuple[int, int]] = set()
        #: Rows that every program begins with.
        self.lasting: dict[tuple[int, int], None] = {}
        #: Parameters that need the least m.
        self.centre = start
        #: Joint and row on which that m rests most: it would fall fastest if this bound were wider.
        self.worst = (0, 0)
        self._add(start, everywhere=True)
        self.lasting |= dict.fromkeys(self.active)

    def least(self) -> float:
        """The smallest m with |τ - Φθ| ≤ m ε on all rows (Chebyshev's approximation)."""
        from scipy.optimize import linprog

        size = self.rows.size
        cost = np.append(np.zeros(size), 1.0)
        while True:
            phi, tau, bound = self._matrix()
            upper = np.vstack([np.c_[phi, -bound], np.c_[-phi, -bound]])
            free = [(None, None)] * size + [(0.0, None)]
            made = linprog(cost, upper, np.concatenate([tau, -tau]), bounds=free)
            if made.x is None:
                raise IdentificationError(f"a linear program failed: {made.message}")
            self.centre = made.x[:size] / self.scale
            prices = np.abs(made.ineqlin.marginals.reshape(2, -1)).max(axis=0)
            self.worst = self.active[int(np.argmax(prices))]
            if not self._add(self.centre, factor=float(made.x[size])):
                self._keep(prices > 0.0)
                return float(made.x[size])

    def extreme(self, i: int, sign: float) -> float:
        """Smallest (sign 1) or largest (sign -1) value of parameter i."""
        from scipy.optimize import Bounds, LinearConstraint, milp

        cost = np.zeros(self.rows.size)
        cost[i] = sign
        self.active, self.known = list(self.lasting), set(self.lasting)
        while True:
            phi, tau, bound = self._matrix()
            # `milp` takes both bounds of a row at once, `linprog` makes two rows of it
            between = LinearConstraint(phi, tau - bound, tau + bound)
            made = milp(cost, constraints=between, bounds=Bounds(-np.inf, np.inf))
            if made.status in _UNBOUNDED:
                return -sign * np.inf
            if made.x is None:
                raise IdentificationError(f"a linear program failed: {made.message}")
            if not self._add(made.x / self.scale):
                self._keep(np.abs(tau - phi @ made.x) > (1.0 - AT_BOUND) * bound)
                return float(made.x[i] / self.scale[i])

    def _keep(self, bind: np.ndarray) -> None:
        """Begin later programs with the rows that bind a solution, too."""
        for k in np.flatnonzero(bind).tolist():
            self.lasting[self.active[k]] = None

    def _add(self, theta: np.ndarray, factor: float = 1.0, everywhere: bool = False) -> bool:
        """Add the rows that θ violates most; whether there were any."""
        size = np.abs(self.rows.residuals(theta)) / self.relative[:, None]
        added = False
        for j, own in enumerate(size):
            worst = np.argsort(own)[::-1][:ADDED]
            for row in worst.tolist():
                if own[row] <= factor * (1.0 + SLACK) and not everywhere:
                    break
                if (j, row) not in self.known and self.rows.joints[j].used[row]:
                    self.known.add((j, row))
                    self.active.append((j, row))
                    added = True
        return added

    def _matrix(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Φ in scaled columns, τ and ε of the rows that are known to matter."""
        phi, tau = np.zeros((len(self.active), self.rows.size)), np.empty(len(self.active))
        bound = np.empty(len(self.active))
        for k, (j, row) in enumerate(self.active):
            own = self.rows.joints[j]
            phi[k, own.columns] = own.phi[:, row]
            tau[k], bound[k] = own.tau[row], self.relative[j]
        return phi / self.scale, tau, bound
