"""Filtered rows of one joint from the last estimate, with exchangeable columns.

Signals, filter or decimation, and valid samples are those of the last estimate. Unchanged columns
are filtered once and kept; columns of another friction law or with other constants are computed
on demand and filtered in the same way.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pivident.dynamics.regressor import Regressor
from pivident.estimation.auxiliary_model import AuxiliaryModel
from pivident.estimation.decimated import DecimatedRecord, decimated_sums
from pivident.estimation.equations import Equations, Motion
from pivident.estimation.full_rate import FullRateRecord, accumulate
from pivident.estimation.identification import Identification
from pivident.estimation.inner_signals import packed_stretch
from pivident.estimation.methods import Bandpass, Method
from pivident.estimation.normal_equations import JointSums
from pivident.estimation.problem import Problem
from pivident.signals.decimation import parallel_decimation

#: Number of samples for which the columns are computed at a time.
BLOCK = 16384


@dataclass(frozen=True, eq=False)
class KeptRows:
    """Filtered columns of one record, zero where a sample is excluded; time is the last axis."""

    phi: np.ndarray  # observation matrix, shape (columns, rows)
    z: np.ndarray | None  # instruments, likewise; None: least squares
    tau: np.ndarray  # torque, shape (rows,)
    valid: np.ndarray  # 1 where a sample is used, 0 elsewhere, likewise


@dataclass(frozen=True, eq=False)
class LastPass:
    """Equations of an estimate in which columns can be changed."""

    equations: Equations  # of the last iteration
    signals: Bandpass | None  # options of a band-pass method; None at full rate
    motions: tuple[Motion, ...] | None  # simulated motion of each record; None: least squares

    @classmethod
    def of(cls, problem: Problem, method: Method, found: Identification) -> LastPass:
        """From an estimate; the motion of a decimated record is not kept and simulated again."""
        assert found.equations is not None
        equations, motions = found.equations, None
        signals = method.signals if isinstance(method.signals, Bandpass) else None
        if equations.has_instruments and signals is None:
            kept = [r.motion for r in equations.records if isinstance(r, FullRateRecord)]
            motions = tuple(m for m in kept if m is not None)
        elif equations.has_instruments:
            motions = tuple(AuxiliaryModel(problem, differences=False).simulate(found.theta))
        return cls(equations, signals, motions)

    def sums(self) -> list[JointSums]:
        """Normal equations of all joints, with their windows."""
        eq = self.equations
        if self.signals is None:
            full = [r for r in eq.records if isinstance(r, FullRateRecord)]
            return accumulate(eq.regressor, full, eq.filters)
        thin = [r for r in eq.records if isinstance(r, DecimatedRecord)]
        return decimated_sums(eq.regressor, thin)

    def rows_of(self, joint: int, keep: np.ndarray) -> list[KeptRows]:
        """Filtered columns of one joint for each record; ``keep`` indexes ``columns_of(joint)``."""
        count = len(self.equations.records)
        return [self._kept(self.equations.records[k], k, joint, keep) for k in range(count)]

    def changed(
        self, regressor: Regressor, joint: int, rows: Sequence[KeptRows]
    ) -> list[tuple[np.ndarray, np.ndarray | None]]:
        """Columns of Φ and of Z of another regressor of one joint, on these rows."""
        made = []
        for number, own in enumerate(rows):
            record = self.equations.records[number]
            phi = self.passed(_whole(regressor, record.kinematics), number, joint) * own.valid
            z = None
            if self.motions is not None:
                z = self.passed(_whole(regressor, self.motions[number]), number, joint)
                z = z * own.valid
            made.append((phi, z))
        return made

    def passed(self, columns: np.ndarray, number: int, joint: int) -> np.ndarray:
        """Columns on all samples of a record through the joint's filter or decimation."""
        if self.signals is None:
            stream = self.equations.filters[joint].stream(len(columns), threads=1)
            return stream.process(columns)
        k = self.equations.records[number].kinematics
        factor = self.signals.factor(k.recording.rate)
        part = columns[:, k.start : k.stop].T
        return parallel_decimation(part, factor, convention=self.signals.convention).T

    def _kept(
        self, record: FullRateRecord | DecimatedRecord, number: int, j: int, keep: np.ndarray
    ) -> KeptRows:
        regressor, filters = self.equations.regressor, self.equations.filters
        own = slice(regressor.offsets[j], regressor.offsets[j + 1])
        valid = record.votes[j].astype(float)
        if isinstance(record, DecimatedRecord):
            z = None if record.z is None else record.z[own][keep] * valid
            return KeptRows(record.phi[own][keep] * valid, z, record.tau[j] * valid, valid)
        sources: list[Motion] = [record.kinematics]
        if self.motions is not None:
            sources.append(self.motions[number])
        filtered = []
        for source in sources:
            stream = filters[j].stream(keep.size, threads=1)
            out = np.empty((keep.size, valid.size))
            for first in range(0, valid.size, BLOCK):
                span = slice(first, min(first + BLOCK, valid.size))
                out[:, span] = stream.process(packed_stretch(regressor, source, span)[own][keep])
            filtered.append(out * valid)
        tau = filters[j].stream(1).process(record.kinematics.tau[j : j + 1])[0]
        return KeptRows(
            filtered[0], filtered[1] if len(filtered) == 2 else None, tau * valid, valid
        )


def _whole(regressor: Regressor, motion: Motion) -> np.ndarray:
    """Packed columns of a whole record."""
    return regressor.packed(motion.q, motion.dq, motion.ddq)
