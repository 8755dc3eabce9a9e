"""What is held out while laws are compared: whole motions, or parts that differ from the rest.

The motion is cut into cells of equal length. With several recordings each of them is held out in
turn, because a law has to fit the next motion. With one recording, contiguous blocks are held out
in turn, and then the cells in which a joint is fastest, slowest, most and least loaded, and the
first and last ones, between which a machine warms up: a law that only interpolates fails there.
Beside a held-out cell a gap is left out over which noise and model error forget each other.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pivident.errors import IdentificationError
from pivident.estimation.problem import Problem
from pivident.friction_laws.filtered_rows import LastPass
from pivident.text.lists import listed
from pivident.validation.held_out.folds import moving_part
from pivident.validation.held_out.segment_sums import Segments

#: Cells of all recordings together, if the motion is long enough.
CELLS = 40

#: Shortest cell, in gaps.
SHORTEST = 5.0

#: Share of the cells that is held out at either end of speed, load and time.
ENDS = 1.0 / 3.0

#: A joint moves in a recording if its mean speed there is above this share of the largest one.
MOVES = 0.1

#: Fewest contiguous blocks that are held out in turn.
MIN_FOLDS = 3


@dataclass(frozen=True, eq=False)
class Division:
    """Cells that are held out together."""

    name: str  # of the direction in which they differ from the fitted ones
    held_out: np.ndarray  # True for cells that are, shape (cells,)


@dataclass(frozen=True, eq=False)
class Cells:
    """The cells of all recordings, in order."""

    segments: Segments
    record: np.ndarray  # recording of each cell, shape (cells,)
    names: tuple[str, ...]  # of the recordings
    folds: int  # contiguous blocks of a single recording
    gap: float  # between held-out and fitted cells [s]

    @classmethod
    def of(cls, problem: Problem, last: LastPass, folds: int, gap: float) -> Cells:
        """Cut the moving part of all recordings.

        Raises:
            IdentificationError: too few blocks, or blocks without samples.
        """
        if folds < MIN_FOLDS:
            raise IdentificationError(
                f"folds is {folds}", advice=f"laws are compared on at least {MIN_FOLDS} blocks"
            )
        records = last.equations.records
        moving = [moving_part(problem, r.kinematics) for r in records]
        recordings = [r.kinematics.recording for r in records]
        seconds = np.ptp(moving, axis=1) / [r.rate for r in recordings]
        counts = _counts(seconds, folds, gap)
        labels, first = [], 0
        for record, (start, stop), count in zip(records, moving, counts, strict=True):
            half = 0.5 * gap * record.kinematics.recording.rate
            labels.append(_labels(record.sample_numbers, start, stop, count, half, first))
            first += count
        if not np.isin(2 * np.arange(first), np.concatenate(labels)).all():
            raise IdentificationError(
                f"{folds} blocks with gaps of {gap:.2g} s leave no samples in some blocks",
                advice="use fewer",
            )
        names = tuple(f"recording {k + 1}, {r.name}" for k, r in enumerate(recordings))
        owner = np.repeat(np.arange(len(records)), counts)
        return cls(Segments(tuple(labels), first), owner, names, folds, gap)

    def in_words(self, alone: Sequence[str]) -> str:
        """What is held out; ``alone``: joints that move in one recording only."""
        parts = (
            f"{self.folds} blocks of the motion in turn, then the thirds in which a joint is "
            "slowest, fastest, least and most loaded, the first and the last"
        )
        if len(self.names) == 1:
            return parts
        whole = f"each of {len(self.names)} recordings in turn"
        return f"{whole}; of {listed(alone)}, which move in one only, {parts}" if alone else whole

    def divisions(self, speed: np.ndarray, load: np.ndarray) -> list[Division]:
        """What is held out for one joint.

        Args:
            speed: mean size of the joint's speed in each cell, shape (cells,).
            load: likewise of the torque that it carries.
        """
        own = [self.record == number for number in range(len(self.names))]
        mean = np.array([speed[cells].mean() for cells in own])
        if np.sum(mean > MOVES * mean.max()) > 1:
            return [Division(name, cells) for name, cells in zip(self.names, own, strict=True)]
        order = np.arange(self.record.size)
        block = order * self.folds // order.size
        made = [Division("blocks in turn", block == k) for k in range(self.folds)]
        for values, low, high in (
            (speed, "slowest part", "fastest part"),
            (load, "least loaded part", "most loaded part"),
            (order, "first part", "last part"),
        ):
            rank = np.argsort(np.argsort(values, kind="stable"))
            count = round(ENDS * order.size)
            made.append(Division(low, rank < count))
            made.append(Division(high, rank >= order.size - count))
        return made

    def thinned(self, steps: Sequence[int]) -> Segments:
        """Segments of every so many rows of each recording."""
        labels = [own[::step] for own, step in zip(self.segments.labels, steps, strict=True)]
        return Segments(tuple(labels), self.segments.cells)

    def by_cell(self, values: Sequence[np.ndarray], reduce) -> np.ndarray:
        """A number of each cell from the values on the rows of each recording, shape (cells,)."""
        found = np.zeros(self.segments.cells)
        for number, own in enumerate(values):
            for label, span in self.segments.parts(number):
                if label % 2 == 0:
                    found[label // 2] = reduce(own[span])
        return found


def _counts(seconds: np.ndarray, folds: int, gap: float) -> np.ndarray:
    """Cells of each recording; of a single one a multiple of the folds."""
    if seconds.size == 1:
        finer = min(seconds[0] / max(SHORTEST * gap, 1e-12), CELLS) // folds
        return np.array([folds * max(int(finer), 1)])
    shares = CELLS * seconds / seconds.sum()
    longest = np.maximum(seconds / max(SHORTEST * gap, 1e-12), 1.0)
    return np.maximum(np.minimum(shares, longest).round().astype(int), 1)


def _labels(
    sample: np.ndarray, start: int, stop: int, count: int, half: float, first: int
) -> np.ndarray:
    """Segment of each row of one recording, whose cells are numbered from ``first``."""
    borders = np.linspace(start, stop, count + 1)
    cell = np.clip(np.searchsorted(borders, sample, side="right") - 1, 0, count - 1)
    label = 2 * (first + cell)
    for number, border in enumerate(borders[1:-1]):
        label[np.abs(sample - border) < half] = 2 * (first + number) + 1
    return np.where((sample >= start) & (sample < stop), label, -1)
