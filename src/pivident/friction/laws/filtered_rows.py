"""Rows of one joint as an estimator saw them, with columns that can be exchanged.

Signals, filter or decimation, and votes are those of the last estimate. Columns that stay are
filtered once and kept; others, of another friction law or with other constants, are made on demand
and go the same way.
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

#: Samples that the columns are made for at a time.
BLOCK = 16384


@dataclass(frozen=True, eq=False)
class KeptRows:
    """Columns of one record, filtered, zero where a sample does not vote; time last."""

    phi: np.ndarray  # observation matrix, shape (columns, rows)
    z: np.ndarray | None  # instruments, likewise; None: least squares
    tau: np.ndarray  # torque, shape (rows,)
    votes: np.ndarray  # 1 where a sample counts, 0 elsewhere, likewise


@dataclass(frozen=True, eq=False)
class LastPass:
    """Equations of an estimate with what is needed to change columns in them."""

    equations: Equations  # as the estimate left them
    signals: Bandpass | None  # recipe of a band-pass method; None at full rate
    motions: tuple[Motion, ...] | None  # simulated motion of each record; None: least squares

    @classmethod
    def of(cls, problem: Problem, method: Method, found: Identification) -> LastPass:
        """Of an estimate; a decimated record has not kept its simulated motion: once more."""
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
            phi = self.passed(_whole(regressor, record.kinematics), number, joint) * own.votes
            z = None
            if self.motions is not None:
                z = self.passed(_whole(regressor, self.motions[number]), number, joint)
                z = z * own.votes
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
        votes = record.votes[j].astype(float)
        if isinstance(record, DecimatedRecord):
            z = None if record.z is None else record.z[own][keep] * votes
            return KeptRows(record.phi[own][keep] * votes, z, record.tau[j] * votes, votes)
        sources: list[Motion] = [record.kinematics]
        if self.motions is not None:
            sources.append(self.motions[number])
        filtered = []
        for source in sources:
            stream = filters[j].stream(keep.size, threads=1)
            out = np.empty((keep.size, votes.size))
            for first in range(0, votes.size, BLOCK):
                span = slice(first, min(first + BLOCK, votes.size))
                out[:, span] = stream.process(packed_stretch(regressor, source, span)[own][keep])
            filtered.append(out * votes)
        tau = filters[j].stream(1).process(record.kinematics.tau[j : j + 1])[0]
        return KeptRows(
            filtered[0], filtered[1] if len(filtered) == 2 else None, tau * votes, votes
        )


def _whole(regressor: Regressor, motion: Motion) -> np.ndarray:
    """Packed columns on a whole record."""
    return regressor.packed(motion.q, motion.dq, motion.ddq)
