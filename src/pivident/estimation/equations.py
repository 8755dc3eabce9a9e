"""The equations that an estimate solved last, kept so that they can be doubted afterwards.

Sums over the whole record suffice to solve, not to test: a robust covariance needs the scores
ζ_t ε_t in their order, an over-identification test needs further instruments. Signals, simulated
motion and prefilters are kept instead, and the weighted columns

    Φ_j λ_j^(-1/2),   Z_j λ_j^(1/2 - w),   τ_j λ_j^(-1/2)         so that Zᵀ(τ - Φθ) = 0 at θ̂

are made again block by block. Nothing of the size of the observation matrix is held.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Protocol, cast

import numpy as np

from pivident.dynamics.regressor import Regressor
from pivident.estimation.decimated import DecimatedRecord
from pivident.estimation.full_rate import FullRateRecord
from pivident.estimation.inner_signals import packed_stretch
from pivident.signals.prefilter import Prefilter, StreamingFilter
from pivident.threads import run_in_threads

#: Samples per block.
BLOCK = 4096


class Motion(Protocol):
    """Positions, speeds and accelerations, each (joints, samples)."""

    @property
    def q(self) -> np.ndarray:
        """Positions [rad or m]."""

    @property
    def dq(self) -> np.ndarray:
        """Speeds [rad/s or m/s]."""

    @property
    def ddq(self) -> np.ndarray:
        """Accelerations [rad/s² or m/s²]."""

    @property
    def inner(self) -> np.ndarray | None:
        """Columns with memory or load, (inner entries, samples), where there are any."""

    def stretch(self, span: slice) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """q, dq and ddq on some samples."""


@dataclass(frozen=True, eq=False)
class JointRows:
    """Weighted and prefiltered rows of one joint in one block; zero where a sample has no vote.

    Attributes:
        columns: parameters that act on the joint, shape (k,).
        phi: observation matrix, shape (k, samples), time last.
        z: instruments, likewise; the observation matrix itself for least squares.
        extra: further instruments, likewise, or None.
        tau: torque, shape (samples,).
        votes: samples that count, shape (samples,).
    """

    columns: np.ndarray
    phi: np.ndarray
    z: np.ndarray
    extra: np.ndarray | None
    tau: np.ndarray
    votes: np.ndarray


@dataclass(frozen=True, eq=False)
class Block:
    """A stretch of one record.

    Attributes:
        record: its number.
        span: rows of the record.
        joints: rows of each joint.
    """

    record: int
    span: slice
    joints: tuple[JointRows, ...]


@dataclass(frozen=True, eq=False)
class Equations:
    """Everything that the last pass of an estimator was made of.

    Attributes:
        regressor: the observation matrix.
        records: recordings with instruments and votes.
        filters: prefilter of each joint; of no use to decimated records.
        variance: λ of each joint, shape (joints,).
        weight_power: w, power of λ in the weights.
    """

    regressor: Regressor
    records: tuple[FullRateRecord, ...] | tuple[DecimatedRecord, ...]
    filters: tuple[Prefilter, ...]
    variance: np.ndarray
    weight_power: float = 1.0

    @property
    def size(self) -> int:
        """Number of parameters."""
        return len(self.regressor.parameters)

    @property
    def lengths(self) -> list[int]:
        """Rows of each record."""
        return [r.votes.shape[1] for r in self.records]

    @property
    def has_instruments(self) -> bool:
        """Whether instruments differ from the observation matrix."""
        first = self.records[0]
        return (first.motion if isinstance(first, FullRateRecord) else first.z) is not None

    def blocks(
        self, extra: Sequence[Motion] | Sequence[np.ndarray] | None = None
    ) -> Iterator[Block]:
        """The rows of all records in order.

        Args:
            extra: for each record another motion (of decimated records its packed columns),
                whose columns less the instruments' own are further instruments. The difference
                spans with Z what the columns themselves do, and keeps its digits where they are
                almost alike.
        """
        for number, record in enumerate(self.records):
            other: Any = None if extra is None else extra[number]
            if isinstance(record, FullRateRecord):
                yield from self._full_rate(number, record, other)
            else:
                yield self._decimated(number, cast(DecimatedRecord, record), other)

    def _full_rate(
        self, number: int, record: FullRateRecord, extra: Motion | None
    ) -> Iterator[Block]:
        motions: list[Motion] = [record.kinematics]
        motions += [] if record.motion is None else [record.motion]
        motions += [] if extra is None else [extra]
        joints = range(self.regressor.robot.size)
        streams = [
            self.filters[j].stream(len(motions) * self.regressor.columns_of(j).size + 1, threads=1)
            for j in joints
        ]
        samples = record.votes.shape[1]
        for first in range(0, samples, BLOCK):
            span = slice(first, min(first + BLOCK, samples))
            packed = [packed_stretch(self.regressor, m, span) for m in motions]
            if extra is not None:
                packed[-1] = packed[-1] - packed[-2]
            rows: list[JointRows | None] = [None] * len(joints)

            def work(j: int, packed=packed, span=span, rows=rows) -> None:
                own = slice(self.regressor.offsets[j], self.regressor.offsets[j + 1])
                stack = np.vstack(
                    [p[own] for p in packed] + [record.kinematics.tau[j : j + 1, span]]
                )
                parts = _filtered_parts(streams[j], stack, own.stop - own.start)
                rows[j] = self._weighted(
                    j,
                    parts[0],
                    parts[1] if record.motion is not None else None,
                    parts[-2] if extra is not None else None,
                    parts[-1][0],
                    record.votes[j, span],
                )

            run_in_threads(work, joints)
            yield Block(number, span, tuple(r for r in rows if r is not None))

    def _decimated(self, number: int, record: DecimatedRecord, extra: np.ndarray | None) -> Block:
        rows = []
        for j in range(self.regressor.robot.size):
            own = slice(self.regressor.offsets[j], self.regressor.offsets[j + 1])
            z = None if record.z is None else record.z[own]
            other = None if extra is None or z is None else extra[own] - z
            rows.append(
                self._weighted(j, record.phi[own], z, other, record.tau[j], record.votes[j])
            )
        return Block(number, slice(0, record.t.size), tuple(rows))

    def _weighted(
        self,
        j: int,
        phi: np.ndarray,
        z: np.ndarray | None,
        extra: np.ndarray | None,
        tau: np.ndarray,
        votes: np.ndarray,
    ) -> JointRows:
        """Weights on both sides, and zeros where a sample does not vote."""
        root = np.sqrt(self.variance[j])
        left = votes / root
        right = left * root ** (2.0 - 2.0 * self.weight_power)
        return JointRows(
            self.regressor.columns_of(j),
            phi * left,
            (phi if z is None else z) * right,
            None if extra is None else extra * right,
            tau * left,
            votes,
        )


def _filtered_parts(stream: StreamingFilter, stack: np.ndarray, width: int) -> list[np.ndarray]:
    """Stacked columns through a joint's prefilter, apart again."""
    return np.split(stream.process(stack), range(width, stack.shape[0], width))
