"""Contiguous blocks of a record that are held out, and what is left to fit.

Neighbouring samples of a motion are almost the same, so single samples cannot be held out: whole
blocks are, with a gap on either side over which noise and model error forget each other, and over
which filters forget what they have seen. The motion is smoothed once for all methods and folds.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from pivident.data.recording.recording import Recording
from pivident.estimation.problem import Problem
from pivident.foundation.errors import Advised, ExperimentError, PividentError, UnusableValue
from pivident.judgement.validation.held_out.prediction import Judge, motion_band
from pivident.loop.motion.motion import Kinematics

if TYPE_CHECKING:
    from pivident.judgement.validation.held_out.replay import Replay

#: Shorter blocks are too short to be judged on, shorter remainders to be fitted: seconds, samples.
MIN_S = 0.3
MIN_SAMPLES = 250


@dataclass(frozen=True)
class Piece:
    """A stretch of one recording."""

    recording: int  # its number
    start: int  # first sample
    stop: int  # one past the last

    @property
    def span(self) -> slice:
        """The samples."""
        return slice(self.start, self.stop)


@dataclass(frozen=True, eq=False)
class Fold:
    """One division of the records."""

    #: The block to be judged on; several pieces where it runs over the end of a recording.
    held_out: tuple[Piece, ...]
    left_out: tuple[Piece, ...]  # the same with its gaps: what is not fitted


def moving_part(problem: Problem, kinematics: Kinematics) -> tuple[int, int]:
    """Samples from the first to the last motion of any joint: (start, stop)."""
    limits = problem.low_speeds(kinematics.recording)
    driven = slice(problem.robot.base_joints, None)
    moving = np.flatnonzero((np.abs(kinematics.dq[driven]) > limits[driven, None]).any(axis=0))
    if not moving.size:
        return kinematics.start, kinematics.stop
    return max(int(moving[0]), kinematics.start), min(int(moving[-1]) + 1, kinematics.stop)


@dataclass(frozen=True)
class Division:
    """Into how many blocks a motion is cut."""

    count: int  # nearest to what was asked for; 0: no motion is held out
    gap: float  # left out on either side of a block [s]
    wanted: int  # what was asked for
    reason: Advised | None = None  # why it is another number; None where it is not

    @property
    def line(self) -> str:
        """The reason as a sentence, empty without one."""
        blocks = f"{self.count} blocks are held out in turn instead of {self.wanted}"
        head = blocks if self.count else "Nothing is held out"
        return f"{head}: {self.reason}." if self.reason else ""


def nearest_division(
    recordings: Sequence[Recording], moving: Sequence[tuple[int, int]], wanted: int, gap: float
) -> Division:
    """The possible number of blocks that is nearest to the one that was asked for.

    Arguments as of :func:`contiguous_folds`; with ``wanted`` below 2 nothing is held out.
    """
    refused = _refusal(recordings, moving, wanted, gap) if wanted > 1 else None
    if wanted < 2 or not refused:
        return Division(wanted if wanted > 1 else 0, gap, wanted)
    samples, rate = sum(stop - start for start, stop in moving), recordings[0].rate
    shortest = min(shortest_block(r) for r in recordings)
    for count in sorted(range(2, samples // shortest + 1), key=lambda n: (abs(n - wanted), n)):
        if not _refusal(recordings, moving, count, gap):
            return Division(count, gap, wanted, refused)
    refused = UnusableValue(
        f"the motion of {samples / rate:.3g} s ({samples} samples at {rate:.6g} Hz) has no room "
        f"for blocks of {shortest / rate:.2g} s and as much to fit beside their gaps of {gap:.2g} "
        "s",
        advice="log for longer, give a second recording, or check the unit of the time",
    )
    return Division(0, gap, wanted, refused)


def _refusal(
    recordings: Sequence[Recording], moving: Sequence[tuple[int, int]], count: int, gap: float
) -> UnusableValue | None:
    """Why the motion cannot be cut into so many blocks; None if it can."""
    lengths = [stop - start for start, stop in moving]
    samples, rate = sum(lengths), recordings[0].rate
    shortest = min(shortest_block(r) for r in recordings)
    if samples // count < shortest:
        return UnusableValue(
            f"{count} folds of a motion of {samples / rate:.3g} s are blocks of "
            f"{samples / count / rate:.2g} s, too short to be judged on",
            advice=f"at least {shortest / rate:.2g} s are needed; ask for fewer folds, or check "
            f"the unit of the time: the log has {samples} samples of motion at {rate:.6g} Hz",
        )
    folds = _divided(recordings, moving, count, gap)
    if samples - max(sum(p.stop - p.start for p in f.left_out) for f in folds) < shortest:
        return UnusableValue(
            f"{count} folds with gaps of {gap:.2g} s leave less than {shortest / rate:.2g} s to "
            "fit",
            advice="ask for more folds, a shorter gap, or give a second recording",
        )
    return None


def contiguous_folds(
    recordings: Sequence[Recording],
    moving: Sequence[tuple[int, int]],
    count: int,
    gap: float,
) -> list[Fold]:
    """Cut the motion of all recordings, one after the other, into blocks of equal length.

    ``moving``: the part (start, stop) of each that is shared out; ``gap``: left out on either side
    of a held-out block [s].
    """
    if count < 2:
        raise ExperimentError(f"folds is {count}", advice="at least 2 are needed")
    if not (np.isfinite(gap) and gap >= 0.0):
        raise ExperimentError(f"gap is {gap!r} s", advice="it must not be negative")
    if refused := _refusal(recordings, moving, count, gap):
        raise ExperimentError.of_part("", refused)
    return _divided(recordings, moving, count, gap)


def _divided(
    recordings: Sequence[Recording], moving: Sequence[tuple[int, int]], count: int, gap: float
) -> list[Fold]:
    """The folds, whatever is left to fit."""
    lengths = [stop - start for start, stop in moving]
    borders = np.linspace(0, sum(lengths), count + 1).round().astype(int)
    offsets = np.r_[0, np.cumsum(lengths)]
    folds = []
    for first, last in pairwise(borders):
        held_out, left_out = [], []
        for k, recording in enumerate(recordings):
            start, stop = moving[k]
            low, high = (int(np.clip(b - offsets[k], 0, lengths[k])) for b in (first, last))
            if low == high:
                continue
            held_out.append(Piece(k, start + low, start + high))
            margin = round(gap * recording.rate)
            ends = max(start, start + low - margin), min(start + high + margin, stop)
            left_out.append(Piece(k, *ends))
        folds.append(Fold(tuple(held_out), tuple(left_out)))
    return folds


def equal_blocks(recording: int, samples: int, count: int) -> list[Piece]:
    """A recording, by its number, cut into blocks of equal length."""
    borders = np.linspace(0, samples, count + 1).round().astype(int)
    return [Piece(recording, int(a), int(b)) for a, b in pairwise(borders)]


def shortest_block(recording: Recording) -> int:
    """Samples of the shortest block to be judged on, and of the shortest remainder to be fitted."""
    return max(round(MIN_S * recording.rate), MIN_SAMPLES)


#: Gap on either side of a held-out block, in periods of the highest frequency of the motion.
GAP_PERIODS = 2.0

#: Length of a record over that of the blocks, from which on it has room for them.
AMPLE = 10


@dataclass(frozen=True, eq=False)
class JudgedMotion:
    """Recordings that are fitted, and those that are not."""

    problem: Problem  # what is fitted
    fitted: tuple[Judge, ...]  # its recordings
    unseen: tuple[Judge, ...] = ()  # recordings that are judged on in place of blocks

    @classmethod
    def of(
        cls, problem: Problem, recording: Recording | Sequence[Recording] | None = None
    ) -> JudgedMotion:
        """Smooth all recordings.

        Raises:
            ExperimentError: a second recording that does not fit, or is the fitted one.
        """
        fitted = tuple(Judge(r) for r in problem.recordings)
        if recording is None:
            return cls(problem, fitted)
        others = (recording,) if isinstance(recording, Recording) else tuple(recording)
        _check_unseen(problem, others)
        return cls(problem, fitted, tuple(Judge(r, fitted[0].band) for r in others))

    @cached_property
    def moving(self) -> list[tuple[int, int]]:
        """The part (start, stop) of each fitted recording between its first and last motion."""
        return [moving_part(self.problem, judge.kinematics) for judge in self.fitted]

    def division(self, wanted: int, gap: float | None = None) -> Division:
        """Into how many blocks the motion is cut; ``gap`` None: ``GAP_PERIODS``."""
        if gap is None:
            gap = GAP_PERIODS / motion_band(self.problem.recordings[0])
        return nearest_division(self.problem.recordings, self.moving, wanted, gap)

    @cached_property
    def replays(self) -> dict[Judge, Replay]:
        """The loops of all recordings, empty without a control law."""
        if self.problem.loop is None:
            return {}
        from pivident.judgement.validation.held_out.replay import Replay

        return {judge: Replay(self.problem, judge) for judge in (self.unseen or self.fitted)}


def division_of(problem: Problem, wanted: int, gap: float | None = None) -> Division:
    """The division that `identify` will find; records of ample length are taken to move."""
    shortest = max(map(shortest_block, problem.recordings))
    if wanted < 2 or sum(r.samples for r in problem.recordings) >= AMPLE * wanted * shortest:
        return Division(wanted, gap or 0.0, wanted)
    try:
        return JudgedMotion.of(problem).division(wanted, gap)
    except PividentError as error:  # too short to be smoothed
        return Division(0, gap or 0.0, wanted, error)


def _check_unseen(problem: Problem, others: Sequence[Recording]) -> None:
    """Refuse a second recording that does not fit, or is no second one."""
    replace(problem, recordings=tuple(others))  # joints and reach
    for other in others:
        for own in problem.recordings:
            if own.q.shape == other.q.shape and np.array_equal(own.q, other.q):
                raise ExperimentError(
                    f"recording {other.name!r} is the one that is fitted",
                    advice="give another one, or use folds",
                )
