"""Equations at the full sampling rate: Φ, instruments and torque through the joints' prefilters.

The record is walked through in blocks. A block's columns are made, filtered with carried states
and added to the normal equations; nothing of the size of the observation matrix is ever held.
"""

from __future__ import annotations

import threading
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pivident.dynamics.regressor import Regressor
from pivident.estimation.covariance.sandwich import windows_of
from pivident.estimation.inner_signals import packed_stretch
from pivident.estimation.kinematics import Kinematics
from pivident.estimation.normal_equations import JointSums
from pivident.estimation.simulated_motion import SimulatedMotion
from pivident.scratch import working_array
from pivident.signals.prefilter import Prefilter
from pivident.threads import run_in_threads

#: Samples per block: the columns of a joint, before and after its filter, stay in the cache.
BLOCK = 4096


@dataclass(frozen=True, eq=False)
class FullRateRecord:
    """One recording at full rate with its instruments and votes.

    Attributes:
        kinematics: estimated motion and torque.
        motion: simulated motion that makes the instruments; None: least squares.
        votes: True where a sample of a joint counts, shape (joints, samples).
    """

    kinematics: Kinematics
    motion: SimulatedMotion | None
    votes: np.ndarray


def voting(kinematics: Kinematics, dq: np.ndarray, limits: np.ndarray) -> np.ndarray:
    """Samples that count: inside the usable range, and faster than the joint's limit.

    Args:
        kinematics: gives the usable range.
        dq: speeds that decide, shape (joints, samples): the instruments', where there are any.
        limits: shape (joints,) [rad/s or m/s]; zero: all samples count.
    """
    votes = np.ones(dq.shape, bool)
    for j in np.flatnonzero(limits > 0.0):
        votes[j] = np.abs(dq[j]) > limits[j]
    votes[:, : kinematics.start] = False
    votes[:, kinematics.stop :] = False
    return votes


def records_with_instruments(
    kinematics: Sequence[Kinematics],
    motions: Sequence[SimulatedMotion],
    limits: Sequence[np.ndarray],
) -> list[FullRateRecord]:
    """All recordings with simulated instruments, whose speeds decide who votes.

    Args:
        kinematics: one for each recording.
        motions: likewise.
        limits: speeds below which a joint's samples do not vote, likewise.
    """
    return [
        FullRateRecord(kin, motion, voting(kin, motion.dq, lim))
        for kin, motion, lim in zip(kinematics, motions, limits, strict=True)
    ]


def records_without_instruments(
    kinematics: Sequence[Kinematics], limits: Sequence[np.ndarray]
) -> list[FullRateRecord]:
    """All recordings for least squares; measured speeds decide who votes.

    Args:
        kinematics: one for each recording.
        limits: speeds below which a joint's samples do not vote, likewise.
    """
    return [
        FullRateRecord(kin, None, voting(kin, kin.dq, lim))
        for kin, lim in zip(kinematics, limits, strict=True)
    ]


def torque_of(regressor: Regressor, motion: Kinematics, theta: np.ndarray) -> np.ndarray:
    """Φθ on a recording, time last, shape (joints, samples).

    Friction that grows with the load takes the one that is with the motion, or else that of θ.
    """
    return regressor.torque(motion.q.T, motion.dq.T, motion.ddq.T, theta, motion.inner).T


def residual_of(regressor: Regressor, kinematics: Kinematics, theta: np.ndarray) -> np.ndarray:
    """τ - Φθ on a recording, time last, shape (joints, samples)."""
    model = torque_of(regressor, kinematics, theta)
    return np.subtract(kinematics.tau, model, out=model)


def accumulate(
    regressor: Regressor,
    records: Sequence[FullRateRecord],
    filters: Sequence[Prefilter],
    by_window: bool = True,
) -> list[JointSums]:
    """Normal equations of all joints over all recordings.

    Args:
        regressor: the observation matrix.
        records: recordings with instruments.
        filters: one prefilter per joint.
        by_window: whether the sums of each window are kept for the sandwich.
    """
    windows = windows_of([r.votes.shape[1] for r in records])
    count = sum(w.count for w in windows) if by_window else 0
    sums = [
        JointSums.empty(name, regressor.columns_of(j), count)
        for j, name in enumerate(regressor.robot.joint_names)
    ]
    for record, own in zip(records, windows, strict=True):
        shares = [list(own.shares(span)) if count else [] for span in _blocks(own.samples)]

        def add(j: int, span: slice, stack, votes=record.votes, shares=shares) -> None:
            sums[j].add_stack(stack, votes[j, span], shares[span.start // BLOCK])

        _walk(regressor, record, filters, add)
    return sums


def filtered(signal: np.ndarray, filters: Sequence[Prefilter]) -> np.ndarray:
    """One signal per joint through the joints' prefilters, shape (joints, samples)."""
    out = working_array(signal.shape)

    def work(j: int) -> None:
        filters[j].stream(1).process(signal[j : j + 1], out[j : j + 1])

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
    k, motion = record.kinematics, record.motion
    sources: list[Kinematics | SimulatedMotion] = [k] if motion is None else [k, motion]
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
                    streams[j].process(stack, stack)
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
