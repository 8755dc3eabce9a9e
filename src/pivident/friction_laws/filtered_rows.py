"""Filtered rows of one joint from the last estimate, with exchangeable columns.

Signals, filter or decimation, and valid samples are those of the last estimate. Unchanged columns
are filtered once and kept; columns of another friction law or with other constants are computed
on demand and filtered in the same way.

Laws are judged below the highest frequency of the motion. Above it a logged torque is noise and
ripple that no friction law explains, and they would hide what laws differ by. Torque and columns
pass the same low-pass without phase; the rows are those of the last estimate, thinned out to what
the band needs.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pivident.dynamics.regressor import Regressor
from pivident.estimation.auxiliary_model import AuxiliaryModel
from pivident.estimation.equation_record import EquationRecord, accumulate
from pivident.estimation.identification import Identification
from pivident.estimation.method import Method
from pivident.estimation.normal_equations import JointSums
from pivident.estimation.problem import Problem
from pivident.estimation.signal_recipes import Decimated
from pivident.estimation.solved_equations import Equations
from pivident.motion.motion import Motion, packed_stretch
from pivident.signals.bandpass import butterworth
from pivident.signals.decimation import parallel_decimation


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


#: Rows that are kept for each period of the highest frequency.
ROWS_PER_PERIOD = 4.0

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
        low = butterworth(columns.T, rate, self.band)
        return np.ascontiguousarray(low[self.samples[number]].T)
