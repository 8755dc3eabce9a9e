"""Held-out errors of one joint's friction laws, and signs that no friction has.

Normal equations add over the cells of the motion, so one pass over the records gives those of every
training set: fitting a law to each of them and judging it on the cells left out costs only the
columns of its terms. Laws are fitted on the rows of the estimator and judged below the highest
frequency of the motion. Shape constants are chosen on each training set among the points that the
search on the whole record visited.

Parameters of a friction law with signs that no friction has.

A law may fit one motion with two terms of opposite sign that nearly cancel; outside of its range
they do not, and a simulated machine gains energy. So each term that takes energy has to take it
alone: viscous slopes, Coulomb levels, powers of the speed, the share of the load, elements that
stick and slip. Stribeck friction is the excess of the level at rest over that of sliding.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pivident.dynamics.parameters import standard_parameters
from pivident.dynamics.regressor import Regressor
from pivident.dynamics.robot_regressor import regressor_of
from pivident.foundation.text.numbers import plus_minus
from pivident.judgement.validation.held_out.segment_sums import SegmentSums, effective_rows
from pivident.loop.motion.motion import with_inner
from pivident.robot.description import Robot
from pivident.robot.friction import FrictionLaw
from pivident.robot.friction_term import FrictionTerm
from pivident.studies.friction_laws.filtered_rows import BandRows, LastPass, row_samples
from pivident.studies.friction_laws.held_out_cells import (
    Cells,
    Division,
    TrainingSet,
    weighted_sums,
)
from pivident.studies.friction_laws.shape_constants import (
    GAMMA,
    ShapeConstant,
    search_constants,
    shape_constants,
)


def has_definite_sign(term: FrictionTerm) -> bool:
    """Whether the parameter of a term must not be negative."""
    return term.is_dissipative or term.column.never_negative


def impossible_terms(law: FrictionLaw, theta: Sequence[float] | np.ndarray) -> set[str]:
    """Stems of the terms with negative parameters that must not be; ``theta``: shape (terms,)."""
    return {
        term.stem
        for term, value in zip(law.terms, theta, strict=True)
        if value < 0.0 and has_definite_sign(term)
    }


def impossible_signs(
    law: FrictionLaw, theta: Sequence[float] | np.ndarray, std: Sequence[float] | np.ndarray
) -> tuple[str, ...]:
    """Terms with negative parameters, each with its estimate ± 2σ.

    Args:
        law: the friction law.
        theta: parameters of its terms, shape (terms,).
        std: their standard errors, likewise.
    """
    impossible = impossible_terms(law, theta)
    return tuple(
        f"{term.stem} = {plus_minus(float(value), 2.0 * float(s))}"
        for term, value, s in zip(law.terms, theta, std, strict=True)
        if term.stem in impossible
    )


@dataclass(frozen=True, eq=False)
class LawScore:
    """One law on one joint."""

    name: str  # what was changed, one change after the other
    law: FrictionLaw  # with its shape constants estimated on the whole record
    unknowns: int  # parameters of the law and free constants
    #: Mean square error in each cell when a division holds it out, zero where it does not, shape
    #: (divisions, cells) [unit²].
    held_out: np.ndarray
    squares: float  # sum of squares over all judged rows, fitted to all of them
    theta: np.ndarray  # estimates of the law's parameters on all rows, in the order of its terms
    std: np.ndarray  # their standard errors, likewise
    free: tuple[str, ...] = ()  # names of the free constants
    #: Those at the bounds of what the motion can determine, where a simpler law is the same.
    at_bound: tuple[str, ...] = ()
    #: Schwarz's criterion with the effective number of rows; only differences matter.
    bic: float = np.nan
    verdict: str = ""  # why it was not chosen; empty where it was

    @property
    def impossible(self) -> tuple[str, ...]:
        """Its parameters with signs that no friction has, in words."""
        return impossible_signs(self.law, self.theta, self.std)

    @property
    def impossible_terms(self) -> set[str]:
        """Stems of these parameters."""
        return impossible_terms(self.law, self.theta)

    @property
    def errors(self) -> np.ndarray:
        """Mean square error of each cell over all divisions, shape (cells,)."""
        return self.held_out.sum(axis=0)

    @property
    def rms(self) -> float:
        """Root of the mean square over all held-out cells."""
        return float(np.sqrt(self.errors.mean()))


class JointJudge:
    """Fits and evaluates friction laws of one joint; the other joints keep theirs.

    ``last`` and ``theta`` are equations and estimate with the present laws, ``by_joint`` the sums
    of each joint's rows on its own columns, ``band`` the highest frequency of the motion [Hz].
    """

    def __init__(
        self,
        last: LastPass,
        robot: Robot,
        joint: int,
        cells: Cells,
        by_joint: Sequence[SegmentSums],
        theta: np.ndarray,
        band: float,
    ) -> None:
        self.last, self.robot, self.joint, self.theta = last, robot, joint, theta
        self.cells, self.segments = cells, cells.segments
        regressor = last.equations.regressor
        own = regressor.columns_of(joint)
        parameters = [regressor.parameters[k] for k in own]
        place = robot.places[joint]
        stays = np.array([p.friction is None or p.joint != place for p in parameters])
        # friction of the joint leaves the unknowns, the law's terms are appended
        leaves = {int(k) for k in own[~stays]}
        #: Parameters that stay, as indices into those of the estimate.
        self.rest = np.array([k for k in range(len(regressor.parameters)) if k not in leaves])
        places = {int(k): i for i, k in enumerate(self.rest)}
        #: Those that act on the joint, as indices into ``rest``.
        self.columns = np.array([places[int(k)] for k in own[stays]], int)
        keep = np.flatnonzero(stays)
        self.rows = last.rows_of(joint, keep)
        self.parts = [(r.phi, r.z, r.tau, r.used) for r in self.rows]
        self.fixed = SegmentSums.of(self.parts, self.segments)
        self.band = BandRows(last, joint, keep, band)
        self.band_segments = cells.thinned(self.band.steps)
        self.band_parts = [(r.phi, None, r.tau, r.used) for r in self.band.rows]
        self.band_fixed = SegmentSums.of(self.band_parts, self.band_segments)
        self.motions = [r.kinematics for r in last.equations.records]
        #: Samples of each recording on whose rows the joint's laws are fitted.
        self.used = [row_samples(r)[r.used[joint]] for r in last.equations.records]
        self.load = self._load()
        self.divisions = self._divisions()
        self.lam = float(last.equations.variance[joint])
        others = weighted_sums(last, [joint], self.segments.count, self.rest, by_joint)
        self.whole = self._training(others, np.arange(self.segments.count))
        self.training = [
            self._training(others, self.segments.training(d.held_out)) for d in self.divisions
        ]
        self._columns: dict[FrictionTerm, list[tuple[np.ndarray, np.ndarray | None]]] = {}
        self._band_sums: dict[FrictionLaw, SegmentSums] = {}

    def score(
        self,
        name: str,
        law: FrictionLaw,
        free: Sequence[str] = (),
        kept: Sequence[str] = (),
    ) -> LawScore:
        """Fit a law and judge it on what each division holds out.

        Args:
            name: of the law.
            law: the law with starting values of its constants.
            free: names of the constants to be found.
            kept: names of constants that were found before; they count as unknowns.
        """
        points: list[tuple[FrictionLaw, SegmentSums, float]] = []

        def evaluate(candidate: FrictionLaw) -> float:
            sums = self.sums(candidate)
            points.append((candidate, sums, self.whole.criterion(sums)))
            return points[-1][2]

        constants: list[ShapeConstant] = []
        if free:
            robot = self.robot.with_friction({self.robot.joint_names[self.joint]: law})
            constants = shape_constants(robot, self.joint, free, self.motions, self.used)
            search_constants(law, constants, evaluate)
        else:
            evaluate(law)
        held_out = np.array(
            [
                self._held_out(min(points, key=lambda p: t.criterion(p[1])), t, d)
                for t, d in zip(self.training, self.divisions, strict=True)
            ]
        )
        # every held-out cell counts once for each division that holds it out
        shares = sum(d.held_out.sum() for d in self.divisions) / self.segments.cells
        best, sums, _ = min(points, key=lambda p: p[2])
        theta, std = self.whole.estimate(sums)
        squares = self.band_sums(best).squares(self.own_theta(theta))
        values = {x.name: x.value for x in best.shapes} | {
            GAMMA: best.slopes[0] if best.slopes else np.nan  # of its smoothed signs
        }
        return LawScore(
            name,
            best,
            len(law.terms) + len(free) + len(kept),
            held_out / shares,
            float(squares.sum()),
            theta[self.rest.size :],
            std,
            (*free, *kept),
            tuple(c.name for c in constants if c.is_bound(values[c.name])),
        )

    def _held_out(
        self, point: tuple[FrictionLaw, SegmentSums, float], training: TrainingSet, d: Division
    ) -> np.ndarray:
        """Mean square error in each held-out cell, shape (cells,)."""
        law, sums, _ = point
        return self.squares_by_cell(law, self.own_theta(training.solve(sums))) * d.held_out

    def squares_by_cell(self, law: FrictionLaw, theta: np.ndarray) -> np.ndarray:
        """Mean square error in each cell, shape (cells,); cells weigh as much as their rows.

        ``theta``: parameters of the joint's columns, those of the law's terms last.
        """
        sums = self.band_sums(law)
        rows = max(float(sums.rows[::2].mean()), 1.0)
        return sums.squares(theta)[::2] / rows

    @property
    def is_alone(self) -> bool:
        """Whether parts of the motion are held out in place of whole recordings."""
        return len(self.divisions) != len(self.cells.names)

    def own_theta(self, theta: np.ndarray) -> np.ndarray:
        """The part of an estimate that acts on the joint, in the order of its columns."""
        return np.r_[theta[self.columns], theta[self.rest.size :]]

    def effective(self, score: LawScore) -> tuple[float, float]:
        """Number of judged rows, and that of independent ones by a law's residual."""
        theta = self.own_theta(self.whole.solve(self.sums(score.law)))
        made = [
            (rows.tau - theta @ np.vstack([rows.phi, extra]))[rows.used > 0]
            for rows, extra in zip(self.band.rows, self._band_columns(score.law), strict=True)
        ]
        return float(sum(x.size for x in made)), effective_rows(made)

    def sums(self, law: FrictionLaw) -> SegmentSums:
        """Normal equations of the joint with a law, on the rows of the estimator."""
        by_term = [self._term(t) for t in self._settled(law).terms]
        new = []
        for record in range(len(self.rows)):
            zs = [columns[record][1] for columns in by_term]
            z = None if zs[0] is None else np.vstack([x for x in zs if x is not None])
            new.append((np.vstack([columns[record][0] for columns in by_term]), z))
        return self.fixed.with_columns(self.parts, new, self.segments)

    def band_sums(self, law: FrictionLaw) -> SegmentSums:
        """Normal equations of the joint with a law, on the rows on which it is judged."""
        if law not in self._band_sums:
            new = [(phi, None) for phi in self._band_columns(law)]
            self._band_sums[law] = self.band_fixed.with_columns(
                self.band_parts, new, self.band_segments
            )
        return self._band_sums[law]

    def _training(self, others: SegmentSums, which: np.ndarray) -> TrainingSet:
        power = self.last.equations.weight_power
        return TrainingSet(others, self.fixed, self.columns, which, self.lam, power)

    def _settled(self, law: FrictionLaw) -> FrictionLaw:
        """The law with the joint's own slopes where it leaves them open."""
        return self.robot.joints[self.joint].with_friction(law).friction

    def _term(self, term: FrictionTerm) -> list[tuple[np.ndarray, np.ndarray | None]]:
        """Columns of one term on the rows of the estimator; kept if it has no free constants."""
        if term in self._columns:
            return self._columns[term]
        regressor, load = self._regressor(term)
        if load:
            columns = self._load_columns(regressor)
        else:
            columns = self.last.changed(regressor, self.joint, self.rows)
        if not any(s.free for s in term.shapes):
            self._columns[term] = columns
        return columns

    def _band_columns(self, law: FrictionLaw) -> list[np.ndarray]:
        """Columns of all terms of a law on the rows on which it is judged, for each record."""
        by_term = []
        for term in self._settled(law).terms:
            regressor, load = self._regressor(term)
            by_term.append(
                self.band.changed(
                    [
                        self._load_column(regressor, m)
                        if load
                        else regressor.packed(m.q, m.dq, m.ddq)
                        for m in self.motions
                    ]
                )
            )
        return [np.vstack([own[n] for own in by_term]) for n in range(len(self.rows))]

    def _regressor(self, term: FrictionTerm) -> tuple[Regressor, bool]:
        """Regressor of one term, with the rigid parameters where it depends on the load."""
        name, place = self.robot.joint_names[self.joint], self.robot.places[self.joint]
        robot = self.robot.with_friction({name: FrictionLaw((term,))})
        own = [p for p in standard_parameters(robot) if p.joint == place and p.friction]
        if not term.depends_on_load:
            return regressor_of(robot, own), False
        carried = [p for p in self.last.equations.regressor.parameters if p.carries_load]
        return regressor_of(robot, [*carried, own[0]]), True

    def _carried(self) -> list[int]:
        parameters = self.last.equations.regressor.parameters
        return [k for k, p in enumerate(parameters) if p.carries_load]

    def _load_columns(self, regressor: Regressor) -> list[tuple[np.ndarray, np.ndarray | None]]:
        """|load| s(dq): the load is that of the estimate's rigid parameters."""
        made = []
        for number, rows in enumerate(self.rows):
            simulated = None if self.last.motions is None else self.last.motions[number]
            pair = [
                self.last.passed(self._load_column(regressor, m), number, self.joint) * rows.used
                for m in (self.motions[number], simulated)
                if m is not None
            ]
            made.append((pair[0], pair[1] if len(pair) == 2 else None))
        return made

    def _load_column(self, regressor: Regressor, motion) -> np.ndarray:
        """The column on all samples of one record, shape (1, samples)."""
        theta = np.r_[self.theta[self._carried()], 0.0]
        row = int(np.flatnonzero(regressor.column == theta.size - 1)[0])
        known = with_inner(regressor, motion, theta)
        return regressor.packed(known.q, known.dq, known.ddq, inner=known.inner)[[row]]

    def _load(self) -> list[np.ndarray]:
        """Torque that the joint carries, on the rows of each record [N m or N]."""
        eq = self.last.equations
        theta = np.zeros_like(self.theta)
        theta[self._carried()] = self.theta[self._carried()]
        return [
            eq.regressor.torque(k.q.T, k.dq.T, k.ddq.T, theta)[row_samples(record), self.joint]
            for record, k in zip(eq.records, self.motions, strict=True)
        ]

    def _divisions(self) -> list[Division]:
        """What is held out: by the joint's speed and load where there is one recording."""
        pairs = zip(self.last.equations.records, self.motions, strict=True)
        speed = [np.abs(k.dq[self.joint, row_samples(r)]) for r, k in pairs]
        load = [np.abs(x) for x in self.load]
        return self.cells.divisions(*(self.cells.by_cell(x, np.mean) for x in (speed, load)))
