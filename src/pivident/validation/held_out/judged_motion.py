"""The motion that estimates are judged on, smoothed once for all methods and folds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from pivident.errors import ExperimentError
from pivident.estimation.problem import Problem
from pivident.recording.recording import Recording
from pivident.validation.held_out.folds import moving_part
from pivident.validation.held_out.prediction import Judge
from pivident.validation.held_out.replay import Replay


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

    @cached_property
    def replays(self) -> dict[Judge, Replay]:
        """The loops of all recordings, empty without a control law."""
        if self.problem.loop is None:
            return {}
        return {judge: Replay(self.problem, judge) for judge in (self.unseen or self.fitted)}


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
