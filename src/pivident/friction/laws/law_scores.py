"""Held-out error of a friction law of one joint.

The motion is cut into contiguous blocks with gaps between them. Normal equations add over blocks,
so one pass over the record gives the sums of all blocks, and every training set (all blocks but
one) is a sum of sums: fitting a law to each training set and evaluating it on the block left out
costs only the columns of its terms. Shape constants are chosen on each training set from the points
that the search on the whole record evaluated.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pivident.dynamics.parameters import standard_parameters
from pivident.dynamics.regressor import Regressor
from pivident.friction.laws.filtered_rows import LastPass
from pivident.friction.laws.shape_constants import ShapeConstant, shape_constants
from pivident.friction.laws.variable_projection import least_norm_solution
from pivident.motion.motion import with_inner
from pivident.robot.description import Robot
from pivident.robot.friction import FrictionColumn, FrictionLaw, FrictionTerm
from pivident.validation.held_out.segment_sums import Segments, SegmentSums

#: Evaluations of the search on the whole record for each constant, after the grid.
EVALUATIONS = 25

_RCOND = 1e-12

#: Terms whose sum is the level at small speed.
_DRY = (FrictionColumn.COULOMB, FrictionColumn.COULOMB_POSITIVE, FrictionColumn.PRESLIDING)


@dataclass(frozen=True, eq=False)
class LawScore:
    """One law on one joint."""

    name: str  # what was changed, one change after the other
    law: FrictionLaw  # with its shape constants estimated on the whole record
    unknowns: int  # parameters of the law and chosen shape constants
    errors: np.ndarray  # mean square error on each held-out block, shape (folds,)
    squares: float  # sum of squares over all rows, fitted to all of them
    theta: np.ndarray  # estimates of the law's parameters on all rows, in the order of its terms
    # Akaike's criterion with the effective number of rows; only differences matter
    aic: float = np.nan
    bic: float = np.nan  # Schwarz's, likewise

    @property
    def physical(self) -> bool:
        """Whether friction dissipates energy: no level or slope is negative, nor that at rest."""
        pairs = list(zip(self.law.terms, self.theta, strict=True))
        level = sum(x for t, x in pairs if t.column in _DRY)
        peak = sum(x for t, x in pairs if t.column in (*_DRY, FrictionColumn.STRIBECK))
        return (
            level >= 0.0 and peak >= 0.0 and all(x >= 0.0 or not t.is_dissipative for t, x in pairs)
        )

    @property
    def rms(self) -> float:
        """Root of the mean square over all held-out blocks."""
        return float(np.sqrt(self.errors.mean()))


class JointJudge:
    """Fits and evaluates friction laws of one joint; the other joints keep theirs.

    ``last`` and ``theta`` are equations and estimate with the present laws, ``by_joint`` the sums
    of each joint's rows on its own columns.
    """

    def __init__(
        self,
        last: LastPass,
        robot: Robot,
        joint: int,
        segments: Segments,
        by_joint: Sequence[SegmentSums],
        theta: np.ndarray,
    ) -> None:
        self.last, self.robot, self.joint, self.theta = last, robot, joint, theta
        self.segments = segments
        regressor = last.equations.regressor
        own = regressor.columns_of(joint)
        parameters = [regressor.parameters[k] for k in own]
        stays = np.array([p.friction is None or p.joint != joint for p in parameters])
        # friction of the joint leaves the unknowns, the law's terms are appended
        leaves = {int(k) for k in own[~stays]}
        rest = [k for k in range(len(regressor.parameters)) if k not in leaves]
        self.rest = np.array(rest)
        self.others = _others(last, joint, segments, self.rest, by_joint)
        place = {k: i for i, k in enumerate(rest)}
        self.columns = np.array([place[int(k)] for k in own[stays]], int)
        self.rows = last.rows_of(joint, np.flatnonzero(stays))
        self.motions = [r.kinematics for r in last.equations.records]
        self._columns: dict[FrictionTerm, list[tuple[np.ndarray, np.ndarray | None]]] = {}

    def score(self, name: str, law: FrictionLaw) -> LawScore:
        """Fit a law and evaluate it on each held-out block."""
        free = [s.name for s in law.shapes if s.free]
        points = self._points(law, free)
        lam = self._variance(min(points, key=lambda p: p[2])[1])
        whole = min(points, key=lambda p: self._criterion(p[1], slice(None), lam))
        errors = []
        for fold in range(self.segments.folds):
            training = self.segments.training(fold)
            best = min(points, key=lambda p: self._criterion(p[1], training, lam))
            theta = self._fit(best[1], training, lam)
            held_out = best[1].squares(theta[self._own(best[1])])[2 * fold]
            errors.append(held_out / max(best[1].rows[2 * fold], 1.0))
        theta = self._fit(whole[1], slice(None), lam)
        return LawScore(
            name,
            whole[0],
            len(law.terms) + len(free),
            np.array(errors),
            float(whole[1].squares(theta[self._own(whole[1])]).sum()),
            theta[self.rest.size :],
        )

    def residual(self, score: LawScore) -> list[np.ndarray]:
        """Residual of a law fitted to all valid rows, for each record."""
        sums = self._sums(score.law)
        theta = self._fit(sums, slice(None), self._variance(sums))[self._own(sums)]
        made = []
        for rows, extra in zip(self.rows, self._law_columns(score.law), strict=True):
            phi = np.vstack([rows.phi, extra[0]])
            made.append((rows.tau - theta @ phi)[rows.used > 0])
        return made

    def _points(
        self, law: FrictionLaw, free: Sequence[str]
    ) -> list[tuple[FrictionLaw, SegmentSums, float]]:
        """Laws along the search for the constants, with their sums and criteria."""
        lam = float(self.last.equations.variance[self.joint])
        points: list[tuple[FrictionLaw, SegmentSums, float]] = []

        def evaluate(candidate: FrictionLaw) -> float:
            sums = self._sums(candidate)
            points.append((candidate, sums, self._criterion(sums, slice(None), lam)))
            return points[-1][2]

        if not free:
            evaluate(law)
            return points
        robot = self.robot.with_friction({self.robot.joint_names[self.joint]: law})
        constants = shape_constants(robot, self.joint, free, self.motions)
        best = self._grid(law, constants, evaluate)
        self._descend(law, constants, best, evaluate)
        return points

    def _grid(self, law: FrictionLaw, constants: Sequence[ShapeConstant], evaluate) -> list[float]:
        """The best point of the grids, constant by constant."""
        best = [c.value for c in constants]
        lowest = np.inf
        for _ in range(1 if len(constants) == 1 else 2):
            for i, c in enumerate(constants):
                for value in c.grid():
                    trial = [*best]
                    trial[i] = float(value)
                    found = evaluate(_with(law, constants, trial))
                    if found < lowest:
                        best, lowest = trial, found
        return best

    def _descend(
        self,
        law: FrictionLaw,
        constants: Sequence[ShapeConstant],
        start: Sequence[float],
        evaluate,
    ) -> None:
        """Nelder and Mead's simplex from the best point of the grids."""
        from scipy.optimize import minimize

        u = np.array([c.coordinate(v) for c, v in zip(constants, start, strict=True)])
        steps = np.array([0.5 * c.span / (len(c.grid()) - 1) for c in constants])
        inward = np.array(
            [-1.0 if x > c.coordinate(c.at(x)) - 1e-9 and c.at(x) >= c.high else 1.0
             for c, x in zip(constants, u, strict=True)]
        )  # fmt: skip
        simplex = np.vstack([u, u + np.diag(inward * steps)])
        minimize(
            lambda x: evaluate(
                _with(law, constants, [c.at(float(v)) for c, v in zip(constants, x, strict=True)])
            ),
            u,
            method="Nelder-Mead",
            options={
                "initial_simplex": simplex,
                "maxfev": EVALUATIONS * len(constants),
                "xatol": 1e-3,
                "fatol": 1e-3,
            },
        )

    def _own(self, sums: SegmentSums) -> np.ndarray:
        """Indices of the joint's columns among the unknowns."""
        terms = sums.ft.shape[1] - self.columns.size
        return np.r_[self.columns, self.rest.size + np.arange(terms)]

    def _system(self, sums: SegmentSums, which, lam: float, name: str) -> tuple:
        """Weighted normal equations over some segments, ``ff`` or ``zf``."""
        own = self._own(sums)
        size = self.rest.size + sums.ft.shape[1] - self.columns.size
        gram, right = np.zeros((size, size)), np.zeros(size)
        n = self.rest.size
        weight = lam if name == "ff" else lam**self.last.equations.weight_power
        vector = "ft" if name == "ff" else "zt"
        gram[:n, :n] = getattr(self.others, name)[which].sum(axis=0)
        right[:n] = getattr(self.others, vector)[which].sum(axis=0)
        gram[np.ix_(own, own)] += getattr(sums, name)[which].sum(axis=0) / weight
        right[own] += getattr(sums, vector)[which].sum(axis=0) / weight
        return gram, right

    def _criterion(self, sums: SegmentSums, which, lam: float) -> float:
        gram, right = self._system(sums, which, lam, "ff")
        total = self.others.tt[which].sum() + sums.tt[which].sum() / lam
        return float(total - right @ least_norm_solution(gram, right, _RCOND))

    def _fit(self, sums: SegmentSums, which, lam: float) -> np.ndarray:
        gram, right = self._system(sums, which, lam, "zf")
        return least_norm_solution(gram, right, _RCOND)

    def _variance(self, sums: SegmentSums) -> float:
        """λ of the joint with this law."""
        lam = float(self.last.equations.variance[self.joint])
        for _ in range(2):
            theta = self._fit(sums, slice(None), lam)[self._own(sums)]
            lam = float(sums.squares(theta).sum() / max(sums.rows.sum(), 1.0))
        return max(lam, 1e-300)

    def _sums(self, law: FrictionLaw) -> SegmentSums:
        parts = []
        for rows, (phi, z) in zip(self.rows, self._law_columns(law), strict=True):
            both = None if z is None or rows.z is None else np.vstack([rows.z, z])
            parts.append((np.vstack([rows.phi, phi]), both, rows.tau, rows.used))
        return SegmentSums.of(parts, self.segments)

    def _law_columns(self, law: FrictionLaw) -> list[tuple[np.ndarray, np.ndarray | None]]:
        """Filtered columns of all terms of a law, for each record."""
        joint = self.robot.joints[self.joint]
        by_term = [self._term(t) for t in joint.with_friction(law).friction.terms]
        made = []
        for record in range(len(self.rows)):
            phis = [columns[record][0] for columns in by_term]
            zs = [columns[record][1] for columns in by_term]
            z = None if zs[0] is None else np.vstack([x for x in zs if x is not None])
            made.append((np.vstack(phis), z))
        return made

    def _term(self, term: FrictionTerm) -> list[tuple[np.ndarray, np.ndarray | None]]:
        """Columns of one term; cached if it has no free constants."""
        if term in self._columns:
            return self._columns[term]
        name = self.robot.joint_names[self.joint]
        robot = self.robot.with_friction({name: FrictionLaw((term,))})
        own = [p for p in standard_parameters(robot) if p.joint == self.joint and p.friction]
        last = self.last
        if term.depends_on_load:
            columns = self._load_columns(robot, own[0])
        else:
            columns = last.changed(Regressor.build(robot, own), self.joint, self.rows)
        if not any(s.free for s in term.shapes):
            self._columns[term] = columns
        return columns

    def _load_columns(self, robot: Robot, own) -> list[tuple[np.ndarray, np.ndarray | None]]:
        """|load| s(dq): the load is that of the estimate's rigid parameters."""
        eq = self.last.equations
        carried = [k for k, p in enumerate(eq.regressor.parameters) if p.carries_load]
        regressor = Regressor.build(robot, [*(eq.regressor.parameters[k] for k in carried), own])
        theta = np.r_[self.theta[carried], 0.0]
        row = int(np.flatnonzero(regressor.column == len(carried))[0])
        made = []
        for number, rows in enumerate(self.rows):
            pair = []
            for motion in (self.motions[number], *self._simulated(number)):
                known = with_inner(regressor, motion, theta)
                column = regressor.packed(known.q, known.dq, known.ddq, inner=known.inner)[[row]]
                pair.append(self.last.passed(column, number, self.joint) * rows.used)
            made.append((pair[0], pair[1] if len(pair) == 2 else None))
        return made

    def _simulated(self, number: int) -> list:
        return [] if self.last.motions is None else [self.last.motions[number]]


def _others(
    last: LastPass,
    joint: int,
    segments: Segments,
    rest: np.ndarray,
    by_joint: Sequence[SegmentSums],
) -> SegmentSums:
    """Weighted sums of all other joints on the parameters that are kept."""
    eq, n, size = last.equations, segments.count, rest.size
    place = np.full(eq.size, -1)
    place[rest] = np.arange(size)
    total = SegmentSums(
        np.zeros((n, size, size)), np.zeros((n, size, size)), np.zeros((n, size)),
        np.zeros((n, size)), np.zeros(n), np.zeros(n),
    )  # fmt: skip
    for i, sums in enumerate(by_joint):
        if i == joint:
            continue
        own, lam = place[eq.regressor.columns_of(i)], float(eq.variance[i])
        total.zf[:, own[:, None], own] += sums.zf / lam**eq.weight_power
        total.zt[:, own] += sums.zt / lam**eq.weight_power
        total.ff[:, own[:, None], own] += sums.ff / lam
        total.ft[:, own] += sums.ft / lam
        total.tt += sums.tt / lam
    return total


def _with(
    law: FrictionLaw, constants: Sequence[ShapeConstant], values: Sequence[float]
) -> FrictionLaw:
    return law.with_shapes({c.name: v for c, v in zip(constants, values, strict=True)})
