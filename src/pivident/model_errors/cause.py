"""A cause of model error: what is wrong, the torque that it would add, and its correction.

A cause of size δ changes the torque by D δ, with D its columns evaluated on a motion. They are the
directions of a score test (Lagrange multipliers): the residual is regressed on them besides Φ.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from pivident.estimation.problem import Problem
from pivident.model_errors.record_motion import RecordMotion

#: Columns of a cause on the motion of a record, shape (columns, joints, samples).
Columns = Callable[[RecordMotion], np.ndarray]

#: A problem without a cause of some size, shape (columns,).
Correction = Callable[[Problem, np.ndarray], Problem]


@dataclass(frozen=True, eq=False)
class Cause:
    """Something that may be wrong with the model, the log or the clock.

    Attributes:
        kind: what (``geometry``, ``delay``, ``torque gain`` …).
        subject: joint that it belongs to; empty for the whole.
        what: what its size is the size of, in words.
        unit: of the size.
        columns: torque per unit of size, shape (columns, joints, samples).
        count: number of columns.
        correct: the problem with the cause corrected; None: it cannot be corrected by its size.
        largest: size up to which the torque is about proportional to it; a larger one is no
            finding, but something else that looks alike.
        smallest: size below which it is something else that looks alike, too.
        is_positive: whether a size below zero makes no sense, as of a compliance.
        by_first: whether the first column's amplitude is the size, since the others come with it
            in other units; else that of several columns is their length.
        is_smooth: whether its columns are as smooth as the motion, without friction: then fewer
            samples do.
        is_rough: whether its columns have derivatives of the load, which are mostly noise on a
            measured motion: then those of the simulated motion stand for them.
        least: share of the residual, fitted and on blocks that were not, from which on it is named.
        least_torque: share of a joint's torque from which on it is named.
    """

    kind: str
    subject: str
    what: str
    unit: str
    columns: Columns
    count: int = 1
    correct: Correction | None = None
    largest: float = np.inf
    smallest: float = 0.0
    is_positive: bool = False
    by_first: bool = False
    is_smooth: bool = False
    is_rough: bool = False
    least: float = 0.0
    least_torque: float = 0.0

    def allows(self, size: np.ndarray) -> bool:
        """Whether a size, shape (columns,), makes sense."""
        return self.smallest <= float(np.linalg.norm(size)) < self.largest and not (
            self.is_positive and float(size[0]) < 0.0
        )

    def __str__(self) -> str:
        return f"{self.kind}{' of ' * bool(self.subject)}{self.subject}: {self.what}"


def on_joint(joint: int, signals: list[np.ndarray], motion: RecordMotion) -> np.ndarray:
    """Torques on one joint alone, shape (columns, joints, samples); each (samples,)."""
    out = np.zeros((len(signals), *motion.q.shape))
    out[:, joint] = signals
    return out
