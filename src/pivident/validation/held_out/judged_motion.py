"""The motion that estimates are judged on, smoothed once for all methods and folds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from pivident.errors import ExperimentError, PividentError
from pivident.estimation.problem import Problem
from pivident.recording.recording import Recording
from pivident.validation.held_out.folds import (
    Division,
    moving_part,
    nearest_division,
    shortest_block,
)
from pivident.validation.held_out.prediction import Judge, motion_band
from pivident.validation.held_out.replay import Replay

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
        return {judge: Replay(self.problem, judge) for judge in (self.unseen or self.fitted)}


def division_of(problem: Problem, wanted: int, gap: float | None = None) -> Division:
    """The division that `identify` will find; records of ample length are taken to move."""
    shortest = max(map(shortest_block, problem.recordings))
    if wanted < 2 or sum(r.samples for r in problem.recordings) >= AMPLE * wanted * shortest:
        return Division(wanted, gap or 0.0, wanted)
    try:
        return JudgedMotion.of(problem).division(wanted, gap)
    except PividentError as error:  # too short to be smoothed
        return Division(0, gap or 0.0, wanted, str(error))


def _check_unseen(problem: Problem, others: Sequence[Recording]) -> None:
    """Refuse a second recording that does not fit, or is no second one."""
    replace(problem, recordings=tuple(others))  # joints and reach
    for other in others:
        for own in problem.recordings:
            if own.q.shape == other.q.shape and np.array_equal(own.q, other.q):
                raise ExperimentError(
                    f"recording {other.name!r} is the one that is fitted; give another one, or "
                    "use folds"
                )
