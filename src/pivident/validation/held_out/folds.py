"""Contiguous blocks of a record that are held out, and what is left to fit.

Neighbouring samples of a motion are almost the same, so single samples cannot be held out: whole
blocks are, with a gap on either side over which noise and model error forget each other, and over
which filters forget what they have seen.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from pivident.errors import ExperimentError
from pivident.estimation.problem import Problem
from pivident.motion.kinematics import Kinematics
from pivident.recording.recording import Recording
from pivident.signals.bandpass import EDGE

#: Shorter blocks are too short to be judged on, shorter remainders to be fitted: seconds, samples.
MIN_S = 0.3
MIN_SAMPLES = 300


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
    moves = np.abs(kinematics.dq[driven]) > limits[driven, None]
    moving = np.flatnonzero(moves.any(axis=0))
    if not moving.size:
        return kinematics.start, kinematics.stop
    return max(int(moving[0]), kinematics.start), min(int(moving[-1]) + 1, kinematics.stop)


def possible_folds(recordings: Sequence[Recording], count: int) -> int:
    """Blocks of recordings that move throughout, long enough to be judged on; at most ``count``.

    Filters take their samples at both ends of each recording. Fewer than two blocks are none.
    """
    samples = sum(max(r.samples - 2 * EDGE, 0) for r in recordings)
    most = samples // max(_shortest(r) for r in recordings)
    return min(count, most) if most > 1 else 0


def check_folds(recordings: Sequence[Recording], count: int) -> None:
    """Refuse blocks that are too short even if the recordings move throughout.

    Raises:
        ExperimentError: says how long the blocks would be, and how long they have to be.
    """
    if count > 1:
        _check_blocks(recordings, sum(max(r.samples - 2 * EDGE, 0) for r in recordings), count)


def _check_blocks(recordings: Sequence[Recording], samples: int, count: int) -> None:
    """Refuse blocks of so many samples in all that are too short to be judged on."""
    shortest = min(_shortest(r) for r in recordings)
    if samples // count >= shortest:
        return
    rate = recordings[0].rate
    raise ExperimentError(
        f"{count} folds of a motion of {samples / rate:.3g} s are blocks of "
        f"{samples / count / rate:.2g} s, too short to be judged on; at least "
        f"{shortest / rate:.2g} s are needed. Ask for fewer folds, or check the unit of the time: "
        f"the log has {samples} samples of motion at {rate:.6g} Hz"
    )


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
        raise ExperimentError(f"folds is {count}; at least 2 are needed")
    if not (np.isfinite(gap) and gap >= 0.0):
        raise ExperimentError(f"gap is {gap!r} s; it must not be negative")
    lengths = [stop - start for start, stop in moving]
    borders = np.linspace(0, sum(lengths), count + 1).round().astype(int)
    offsets = np.r_[0, np.cumsum(lengths)]
    _check_blocks(recordings, sum(lengths), count)
    shortest = min(_shortest(r) for r in recordings)
    folds = []
    for first, last in pairwise(borders):
        held_out, left_out, fitted = [], [], sum(lengths)
        for k, recording in enumerate(recordings):
            start, stop = moving[k]
            low, high = (int(np.clip(b - offsets[k], 0, lengths[k])) for b in (first, last))
            if low == high:
                continue
            held_out.append(Piece(k, start + low, start + high))
            margin = round(gap * recording.rate)
            ends = max(start, start + low - margin), min(start + high + margin, stop)
            left_out.append(Piece(k, *ends))
            fitted -= ends[1] - ends[0]
        if fitted < shortest:
            raise ExperimentError(
                f"{count} folds with gaps of {gap:.2g} s leave nothing to fit; ask for more folds, "
                "a shorter gap, or give a second recording"
            )
        folds.append(Fold(tuple(held_out), tuple(left_out)))
    return folds


def equal_blocks(recording: int, samples: int, count: int) -> list[Piece]:
    """A recording, by its number, cut into blocks of equal length."""
    borders = np.linspace(0, samples, count + 1).round().astype(int)
    return [Piece(recording, int(a), int(b)) for a, b in pairwise(borders)]


def _shortest(recording: Recording) -> int:
    return max(round(MIN_S * recording.rate), MIN_SAMPLES)
