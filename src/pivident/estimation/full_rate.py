"""Equations at the full sampling rate: Φ, instruments and torque through the joints' prefilters.

The record is walked through in blocks. A block's columns are made, filtered with carried states
and added to the normal equations; nothing of the size of the observation matrix is ever held.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import ClassVar, TypeVar

import numpy as np

from pivident.dynamics.regressor import Regressor
from pivident.estimation.covariance.windows import Windows
from pivident.estimation.equation_record import FittedRecording, JointColumns, weighted
from pivident.estimation.normal_equations import JointSums
from pivident.foundation.scratch import working_array
from pivident.foundation.threads import run_in_threads
from pivident.loop.motion.motion import (
    Kinematics,
    Motion,
    SimulatedMotion,
    SpeedLimits,
    measured_samples,
    packed_stretch,
    residual_of,
)
from pivident.signals.prefilter import Prefilter

#: Samples per block: the columns of a joint, before and after its filter, stay in the cache.
BLOCK = 4096

#: Samples per block where a few columns are kept whole.
KEPT_BLOCK = 16384

Rows = TypeVar("Rows")


@dataclass(frozen=True, eq=False)
class FullRateRecord:
    """One recording at full rate with its instruments."""

    kinematics: Kinematics  # estimated motion and torque
    #: Simulated motion that makes the instruments; None: least squares.
    motion: SimulatedMotion | None
    used: np.ndarray  # True for samples of a joint that the estimate uses, shape (joints, samples)
    seen: np.ndarray  # True for samples that filters which begin anew may remember, likewise

    full_rate: ClassVar[bool] = True
    z: ClassVar[None] = None

    @property
    def row_weights(self) -> np.ndarray | None:
        """Weights of the samples, shape (joints, samples); None: all one."""
        weights = self.kinematics.recording.weights
        return None if weights is None else weights.T

    @property
    def has_instruments(self) -> bool:
        """Whether instruments differ from the observation matrix."""
        return self.motion is not None

    @property
    def tau(self) -> np.ndarray:
        """Torque, not prefiltered, shape (joints, samples) [N m or N]."""
        return self.kinematics.tau

    @property
    def usable_rows(self) -> int:
        """Samples between the ends that the smoother distorts."""
        return self.kinematics.stop - self.kinematics.start

    @property
    def sample_numbers(self) -> np.ndarray:
        """0, 1, … as real numbers, shape (samples,)."""
        return np.arange(self.used.shape[1], dtype=float)

    def with_torque(self, tau: np.ndarray) -> FullRateRecord:
        """The same rows with another torque, shape (joints, samples)."""
        return replace(self, kinematics=replace(self.kinematics, tau=tau))

    def add_to(
        self,
        sums: Sequence[JointSums],
        regressor: Regressor,
        filters: Sequence[Prefilter],
        windows: Windows | None,
    ) -> None:
        """Add the filtered rows to the normal equations of all joints."""
        spans = _blocks(self.used.shape[1])
        shares = [list(windows.shares(span)) if windows is not None else [] for span in spans]

        def add(j: int, span: slice, stack: np.ndarray) -> None:
            weights = None if self.row_weights is None else self.row_weights[j, span]
            sums[j].add_stack(stack, self.used[j, span], shares[span.start // BLOCK], weights)

        _walk(regressor, self, filters, add)

    def residual(self, regressor: Regressor, theta: np.ndarray) -> np.ndarray:
        """τ - Φθ, not prefiltered, shape (joints, samples)."""
        return residual_of(regressor, self.kinematics, theta)

    def whitened(
        self, residual: np.ndarray, filters: Sequence[Prefilter], variance: np.ndarray
    ) -> np.ndarray:
        """L_j ε_j λ_j^(-1/2), shape (joints, samples)."""
        white = filtered(residual, filters, self.seen)
        white /= np.sqrt(variance)[:, None]
        return white if self.row_weights is None else white * np.sqrt(self.row_weights)

    def fitted(
        self, regressor: Regressor, theta: np.ndarray, residual: np.ndarray, whitened: np.ndarray
    ) -> FittedRecording:
        """Signals for plots on the usable samples; both residuals are overwritten."""
        k = self.kinematics
        model = np.subtract(k.tau, residual, out=residual)
        whitened[~self.used] = np.nan
        part = slice(k.start, k.stop)
        return FittedRecording.at(
            k,
            part,
            k.recording.t[part],
            (k.tau[:, part], model[:, part]),
            self.used[:, part],
            whitened[:, part],
            k.recording.rate,
        )

    def columns_of(
        self, regressor: Regressor, filters: Sequence[Prefilter], joint: int, keep: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray | None, np.ndarray]:
        """Some of a joint's columns of Φ and Z, and its τ, filtered, on all samples."""
        own = slice(regressor.offsets[joint], regressor.offsets[joint + 1])
        made = []
        for source in self._sources():
            stream = filters[joint].stream(keep.size, threads=1)
            out = np.empty((keep.size, self.used.shape[1]))
            for first in range(0, out.shape[1], KEPT_BLOCK):
                span = slice(first, min(first + KEPT_BLOCK, out.shape[1]))
                columns = packed_stretch(regressor, source, span)[own][keep]
                out[:, span] = stream.process(columns, seen=self.seen[joint, span])
            made.append(out)
        tau = filtered(self.tau[[joint]], filters[joint : joint + 1], self.seen[[joint]])[0]
        return made[0], made[1] if self.has_instruments else None, tau

    def blocks(
        self,
        regressor: Regressor,
        filters: Sequence[Prefilter],
        extra: Motion | None,
        make: Callable[[int, JointColumns, np.ndarray], Rows],
    ) -> Iterator[tuple[slice, tuple[Rows, ...]]]:
        """Walk through the samples: ``make(joint, columns, used)`` of each block and joint."""
        motions = [*self._sources(), *([] if extra is None else [extra])]
        joints = range(regressor.robot.size)
        streams = [
            filters[j].stream(len(motions) * regressor.columns_of(j).size + 1, threads=1)
            for j in joints
        ]
        for span in _blocks(self.used.shape[1]):
            packed = [packed_stretch(regressor, m, span) for m in motions]
            if extra is not None:
                packed[-1] = packed[-1] - packed[-2]
            rows: list[Rows | None] = [None] * len(joints)

            def work(j: int, packed=packed, span=span, rows=rows) -> None:
                own = slice(regressor.offsets[j], regressor.offsets[j + 1])
                stack = np.vstack([p[own] for p in packed] + [self.tau[j : j + 1, span]])
                width = own.stop - own.start
                stack = streams[j].process(stack, seen=self.seen[j, span])
                parts = np.split(stack, range(width, len(stack), width))
                z = parts[1] if self.has_instruments else None
                further = parts[-2] if extra is not None else None
                rows[j] = make(j, (parts[0], z, further, parts[-1][0]), weighted(self, j, span))

            run_in_threads(work, joints)
            yield span, tuple(r for r in rows if r is not None)

    def _sources(self) -> list[Motion]:
        """Motions that make Φ and, where there are instruments, Z."""
        return [self.kinematics] if self.motion is None else [self.kinematics, self.motion]


def valid_samples(kinematics: Kinematics, dq: np.ndarray, limits: SpeedLimits) -> np.ndarray:
    """Samples that may be used: inside the usable range, and faster than the limits.

    ``dq``: speeds that decide, shape (joints, samples): the instruments', where there are any.
    """
    valid = limits.moving(dq) & measured_samples(kinematics)
    valid[:, : kinematics.start] = False
    valid[:, kinematics.stop :] = False
    return valid


def records_with_instruments(
    kinematics: Sequence[Kinematics],
    motions: Sequence[SimulatedMotion],
    limits: Sequence[SpeedLimits],
) -> list[FullRateRecord]:
    """All recordings with instruments, whose speeds decide which samples are used.

    A simulated joint sticks about when the real one does, since the model has its friction. One
    from the record moves on; then the measured speed has to be above the limit, too.
    """
    records = []
    for kin, motion, lim in zip(kinematics, motions, limits, strict=True):
        used = valid_samples(kin, motion.dq, lim)
        if motion.from_record:
            used &= valid_samples(kin, kin.dq, lim)
        if motion.valid is not None:
            used[:, ~motion.valid] = False
        records.append(FullRateRecord(kin, motion, used, used.copy()))
    return records


def records_without_instruments(
    kinematics: Sequence[Kinematics], limits: Sequence[SpeedLimits]
) -> list[FullRateRecord]:
    """All recordings for least squares; measured speeds decide which samples are used."""
    valid = [valid_samples(k, k.dq, limit) for k, limit in zip(kinematics, limits, strict=True)]
    return [
        FullRateRecord(kin, None, used, used.copy())
        for kin, used in zip(kinematics, valid, strict=True)
    ]


def filtered(signal: np.ndarray, filters: Sequence[Prefilter], seen: np.ndarray) -> np.ndarray:
    """One signal per joint through the joints' prefilters, shape (joints, samples).

    ``seen``: samples that the filters may remember, likewise.
    """
    out = working_array(signal.shape)

    def work(j: int) -> None:
        filters[j].stream(1).process(signal[j : j + 1], out[j : j + 1], seen[j])

    run_in_threads(work, range(len(filters)))
    return out


def _blocks(samples: int) -> list[slice]:
    """The stretches in which a record is walked through."""
    return [slice(k, min(k + BLOCK, samples)) for k in range(0, samples, BLOCK)]


def _walk(regressor: Regressor, record: FullRateRecord, filters, add) -> None:
    """Hand the filtered columns of each block and joint to ``add(joint, span, stack)``.

    The stack holds Φ, Z (if there is one) and τ, one below the other.

    Threads take blocks in turn. A joint's filters go on from where the block before left them,
    so each block follows the one before joint by joint, and sums do not depend on the threads.
    """
    k, sources = record.kinematics, record._sources()
    joints = range(regressor.robot.size)
    memory = _StackMemory(regressor, len(sources))
    streams = [
        f.stream(s.stop - s.start, threads=1) for f, s in zip(filters, memory.stacks, strict=True)
    ]
    plain = all(len(f.fir) == 1 and len(f.denominator) == 1 for f in filters)
    spans = _blocks(k.q.shape[1])
    done = [[threading.Event() for _ in joints] for _ in spans]

    def work(block: int) -> None:
        span = spans[block]
        try:
            stacks = memory.of_this_thread(span.stop - span.start)
            for source, place in zip(sources, memory.places, strict=True):
                packed_stretch(regressor, source, span, stacks, place)
            for j in joints:
                stack = stacks[memory.stacks[j]]
                stack[-1] = k.tau[j, span]
                if block > 0:
                    done[block - 1][j].wait()
                if not plain:
                    streams[j].process(stack, stack, record.seen[j, span])
                add(j, span, stack)
                done[block][j].set()
        finally:  # an error must not leave the next block waiting
            for event in done[block]:
                event.set()

    run_in_threads(work, range(len(spans)))


class _StackMemory(threading.local):
    """Where the joints' stacks lie in one array, and that array, made once for each thread.

    Attributes:
        stacks: rows of each joint's stack.
        places: for each source (Φ, then Z) the rows of its entries, shape (entries,).
    """

    def __init__(self, regressor: Regressor, sources: int) -> None:
        counts = np.diff(regressor.offsets)
        ends = np.cumsum(sources * counts + 1)
        starts = ends - sources * counts - 1
        self.stacks = [slice(int(a), int(b)) for a, b in zip(starts, ends, strict=True)]
        within = np.arange(regressor.entries) - regressor.offsets[regressor.row]
        self.places = [
            starts[regressor.row] + s * counts[regressor.row] + within for s in range(sources)
        ]
        self._memory = np.empty(int(ends[-1]) * BLOCK)

    def of_this_thread(self, samples: int) -> np.ndarray:
        """The array of this thread for a block of so many samples, shape (rows, samples)."""
        rows = self.stacks[-1].stop
        return self._memory[: rows * samples].reshape(rows, samples)
