"""Filtered rows of one joint from the last estimate: exchangeable columns, unknown shapes.

Signals, filter or decimation, and valid samples are those of the last estimate. Unchanged columns
are filtered once and kept; columns of another friction law or with other constants are computed
on demand and filtered in the same way.

Laws are judged below the highest frequency of the motion. Above it a logged torque is noise and
ripple that no friction law explains, and they would hide what laws differ by. Torque and columns
pass the same low-pass without phase; the rows are those of the last estimate, thinned out to what
the band needs.

Equations of one joint whose friction has unknown shape constants.

Only the columns of the terms with such a constant change with it, and only on the rows of their own
joint. The other columns, and all their sums, are computed once; a trial of other constants costs
the changed columns, their filter, and their products with the rest. In the unknowns (θ, δu), with
u the coordinates of the constants, the equations are linear around a trial:

    τ = Φ(s) θ + D δu,    D = Σ_k θ_k ∂φ_k/∂u,    instruments (Z(s), D of the simulated motion)

so everything written for θ alone (normal equations, sandwich covariance) applies to both.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pivident.dynamics.parameters import Parameter, standard_parameters
from pivident.dynamics.regressor import Regressor
from pivident.dynamics.robot_regressor import regressor_of
from pivident.estimation.auxiliary_model import AuxiliaryModel
from pivident.estimation.covariance.windows import windows_of
from pivident.estimation.equation_record import EquationRecord, accumulate
from pivident.estimation.identification import Identification
from pivident.estimation.method import Method
from pivident.estimation.normal_equations import JointSums
from pivident.estimation.problem import Problem
from pivident.estimation.signal_recipes import Decimated
from pivident.estimation.solved_equations import Equations
from pivident.foundation.errors import ExperimentError
from pivident.judgement.model_errors.cause_rows import ROWS_PER_PERIOD
from pivident.loop.motion.motion import Motion, packed_stretch
from pivident.robot.description import Robot
from pivident.signals.bandpass import butterworth
from pivident.signals.decimation import parallel_decimation
from pivident.studies.friction_laws.shape_constants import GAMMA, ShapeConstant, with_shapes

#: Half the step of the differences ∂φ/∂u: of ln s, or of the bounds' distance.
STEP = 1e-3


@dataclass(frozen=True, eq=False)
class KeptRows:
    """Filtered columns of one record, zero where a sample is excluded; time is the last axis."""

    phi: np.ndarray  # observation matrix, shape (columns, rows)
    z: np.ndarray | None  # instruments, likewise; None: least squares
    tau: np.ndarray  # torque, shape (rows,)
    used: np.ndarray  # 1 where a sample is used, 0 elsewhere, likewise


@dataclass(frozen=True, eq=False)
class LastPass:
    """Equations of an estimate in which columns can be changed."""

    equations: Equations  # of the last iteration
    signals: Decimated | None  # options of the decimation; None at full rate
    motions: tuple[Motion, ...] | None  # simulated motion of each record; None: least squares

    @classmethod
    def of(cls, problem: Problem, method: Method, found: Identification) -> LastPass:
        """From an estimate; the motion of a decimated record is not kept and simulated again."""
        assert found.equations is not None
        equations, motions = found.equations, None
        recipe = (found.method_used or method).signals
        signals = recipe if isinstance(recipe, Decimated) else None
        if equations.has_instruments and signals is None:
            motions = tuple(r.motion for r in equations.records if r.motion is not None)
        elif equations.has_instruments:
            motions = tuple(AuxiliaryModel(problem, differences=False).simulate(found.theta))
        return cls(equations, signals, motions)

    def sums(self) -> list[JointSums]:
        """Normal equations of all joints, with their windows."""
        eq = self.equations
        return accumulate(eq.regressor, eq.records, eq.filters)

    def rows_of(self, joint: int, keep: np.ndarray) -> list[KeptRows]:
        """Filtered columns of one joint for each record; ``keep`` indexes ``columns_of(joint)``."""
        return [self._kept(record, joint, keep) for record in self.equations.records]

    def changed(
        self, regressor: Regressor, joint: int, rows: Sequence[KeptRows]
    ) -> list[tuple[np.ndarray, np.ndarray | None]]:
        """Columns of Φ and of Z of another regressor of one joint, on these rows."""
        made = []
        for number, own in enumerate(rows):
            record = self.equations.records[number]
            phi = self.passed(_whole(regressor, record.kinematics), number, joint) * own.used
            z = None
            if self.motions is not None:
                z = self.passed(_whole(regressor, self.motions[number]), number, joint)
                z = z * own.used
            made.append((phi, z))
        return made

    def passed(self, columns: np.ndarray, number: int, joint: int) -> np.ndarray:
        """Columns on all samples of a record through the joint's filter or decimation."""
        if self.signals is None:
            stream = self.equations.filters[joint].stream(len(columns), threads=1)
            return stream.process(columns, seen=self.equations.records[number].seen[joint])
        k = self.equations.records[number].kinematics
        factor = self.signals.factor(k.recording.rate)
        part = columns[:, k.start : k.stop].T
        return parallel_decimation(part, factor, convention=self.signals.convention).T

    def _kept(self, record: EquationRecord, j: int, keep: np.ndarray) -> KeptRows:
        """Some of a joint's columns on one record, zero where a sample is not used."""
        regressor, filters = self.equations.regressor, self.equations.filters
        phi, z, tau = record.columns_of(regressor, filters, j, keep)
        used = record.used[j].astype(float)
        return KeptRows(phi * used, None if z is None else z * used, tau * used, used)


def _whole(regressor: Regressor, motion: Motion) -> np.ndarray:
    """Packed columns of a whole record."""
    return regressor.packed(motion.q, motion.dq, motion.ddq)


def row_samples(record: EquationRecord) -> np.ndarray:
    """Nearest sample of the recording to each row, shape (rows,)."""
    return np.rint(record.sample_numbers).astype(int)


#: Samples whose columns are computed at once.
BLOCK = 8192


class BandRows:
    """Low-passed columns of one joint; ``keep`` indexes ``columns_of(joint)``, band in [Hz]."""

    def __init__(self, last: LastPass, joint: int, keep: np.ndarray, band: float) -> None:
        self.last, self.joint, self.band = last, joint, band
        self.rows: list[KeptRows] = []
        self.steps: list[int] = []  # rows of the estimator for each row here
        self.samples: list[np.ndarray] = []  # sample of the recording of each row
        eq = last.equations
        own = slice(eq.regressor.offsets[joint], eq.regressor.offsets[joint + 1])
        for number, record in enumerate(eq.records):
            k, every = record.kinematics, row_samples(record)
            rate = k.recording.rate / max(float(np.median(np.diff(every))), 1.0)
            step = max(int(rate / (ROWS_PER_PERIOD * band)), 1)
            self.steps.append(step)
            self.samples.append(every[::step])
            used = record.used[joint][::step].astype(float)
            columns = np.empty((keep.size, k.q.shape[1]))
            for first in range(0, columns.shape[1], BLOCK):
                span = slice(first, min(first + BLOCK, columns.shape[1]))
                columns[:, span] = packed_stretch(eq.regressor, k, span)[own][keep]
            phi = self._passed(columns, number) * used
            tau = self._passed(k.tau[joint][None], number)[0] * used
            self.rows.append(KeptRows(phi, None, tau, used))

    def changed(self, columns: Sequence[np.ndarray]) -> list[np.ndarray]:
        """Further columns on all samples of each record, on these rows."""
        return [
            self._passed(own, number) * rows.used
            for number, (own, rows) in enumerate(zip(columns, self.rows, strict=True))
        ]

    def _passed(self, columns: np.ndarray, number: int) -> np.ndarray:
        rate = self.last.equations.records[number].kinematics.recording.rate
        return np.ascontiguousarray(butterworth(columns.T, rate, self.band)[self.samples[number]].T)


class ShapedRows:
    """Filtered rows of one joint; columns with unknown ``constants`` are computed on demand."""

    def __init__(self, last: LastPass, robot: Robot, constants: Sequence[ShapeConstant]) -> None:
        self.last, self.robot, self.constants = last, robot, tuple(constants)
        self.joint = j = constants[0].joint
        regressor = last.equations.regressor
        own = regressor.columns_of(j)
        names = {c.name for c in constants}
        shaped = np.array([changes(regressor.parameters[k], j, names) for k in own])
        self.shaped = tuple(regressor.parameters[k].name for k in own[shaped])
        if not self.shaped:
            raise ExperimentError(
                f"the terms of joint {robot.joint_names[j]!r} with {', '.join(sorted(names))} are "
                "not among the parameters to estimate",
                advice="add them, or do not identify the constant",
            )
        self.columns = np.r_[own[~shaped], own[shaped]]
        keep = np.flatnonzero(~shaped)
        self.records = last.rows_of(j, keep)
        self._fixed_sums = JointSums.empty(robot.joint_names[j], self.columns[: keep.size])
        for rows in self.records:
            self._fixed_sums.add(rows.phi, rows.z, rows.tau, None)
        self.rows = sum(int(r.used.sum()) for r in self.records)

    def values(self, coordinates: np.ndarray) -> tuple[ShapeConstant, ...]:
        """The constants at coordinates u, shape (constants,)."""
        return tuple(
            replace(c, value=c.at(float(u)))
            for c, u in zip(self.constants, coordinates, strict=True)
        )

    def sums(self, coordinates: np.ndarray, theta: np.ndarray | None = None) -> JointSums:
        """Normal equations of the joint at coordinates u.

        With ``theta``, δu of each constant is an unknown too, numbered after the parameters.
        """
        moving = self._moving(coordinates, theta)
        s, fixed = self._empty(theta), self._fixed_sums
        k = fixed.columns.size
        s.tt, s.rows = fixed.tt, self.rows
        for name in ("zf", "zz", "ff"):
            getattr(s, name)[:k, :k] = getattr(fixed, name)
        s.zt[:k], s.ft[:k] = fixed.zt, fixed.ft
        for rows, (phi, z) in zip(self.records, moving, strict=True):
            fixed_z, own_z = (rows.phi, phi) if z is None else (rows.z, z)
            assert fixed_z is not None
            for name, left, right, other_left, other_right in (
                ("zf", fixed_z, rows.phi, own_z, phi),
                ("zz", fixed_z, fixed_z, own_z, own_z),
                ("ff", rows.phi, rows.phi, phi, phi),
            ):
                total = getattr(s, name)
                total[:k, k:] += left @ other_right.T
                total[k:, :k] += other_left @ right.T
                total[k:, k:] += other_left @ other_right.T
            s.zt[k:] += own_z @ rows.tau
            s.ft[k:] += phi @ rows.tau
        return s

    def windowed_sums(self, coordinates: np.ndarray, theta: np.ndarray, others: int) -> JointSums:
        """The same with the sums of each window of time, for the sandwich covariance.

        ``others`` constants of other joints come before these among the unknowns.
        """
        windows = windows_of(self.last.equations.lengths)
        s = self._empty(theta, sum(w.count for w in windows), others)
        moving = self._moving(coordinates, theta)
        for rows, (phi, z), own in zip(self.records, moving, windows, strict=True):
            both = np.vstack([rows.phi, phi])
            instruments = None if rows.z is None or z is None else np.vstack([rows.z, z])
            s.add(both, instruments, rows.tau, None, list(own.shares(slice(0, rows.tau.size))))
        s.rows = self.rows
        return s

    def _empty(self, theta: np.ndarray | None, windows: int = 0, others: int = 0) -> JointSums:
        columns = self.columns
        if theta is not None:
            columns = np.r_[columns, theta.size + others + np.arange(len(self.constants))]
        return JointSums.empty(self.robot.joint_names[self.joint], columns, windows)

    def _moving(
        self, coordinates: np.ndarray, theta: np.ndarray | None
    ) -> list[tuple[np.ndarray, np.ndarray | None]]:
        """Changed columns, and with θ the derivatives D, for each record: of Φ and of Z."""
        columns = self._changed(coordinates)
        if theta is None:
            return columns
        own = theta[self.columns[-len(self.shaped) :]]
        parts = [([phi], None if z is None else [z]) for phi, z in columns]
        for i, c in enumerate(self.constants):
            step = STEP if c.logarithmic else STEP * c.span
            shift = np.zeros(len(self.constants))
            shift[i] = step
            # at a bound the difference is one-sided
            ends = [
                c.coordinate(v[i].value)
                for v in (self.values(coordinates + shift), self.values(coordinates - shift))
            ]
            above, below = self._changed(coordinates + shift), self._changed(coordinates - shift)
            for (phis, zs), (phi_a, z_a), (phi_b, z_b) in zip(parts, above, below, strict=True):
                phis.append((own @ (phi_a - phi_b) / (ends[0] - ends[1]))[None])
                if zs is not None and z_a is not None and z_b is not None:
                    zs.append((own @ (z_a - z_b) / (ends[0] - ends[1]))[None])
        return [(np.vstack(phi), None if z is None else np.vstack(z)) for phi, z in parts]

    def _changed(self, coordinates: np.ndarray) -> list[tuple[np.ndarray, np.ndarray | None]]:
        """Columns of the terms with unknown constants, filtered, for each record: of Φ and Z."""
        robot = with_shapes(self.robot, self.values(coordinates))
        by_name = {p.name: p for p in standard_parameters(robot)}
        regressor = regressor_of(robot, [by_name[name] for name in self.shaped])
        return self.last.changed(regressor, self.joint, self.records)


def changes(p: Parameter, joint: int, names: set[str]) -> bool:
    """Whether a parameter's column changes with one of the joint's constants."""
    if p.friction is None or p.joint != joint:
        return False
    return any(s.name in names for s in p.friction.shapes) or (
        GAMMA in names and p.friction.has_sign and not p.friction.depends_on_load
    )
