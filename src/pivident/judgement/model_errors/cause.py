"""A cause of model error: what is wrong with the motion of a record, its torque, its correction.

A cause of size δ changes the torque by D δ, with D its columns evaluated on a motion. They are the
directions of a score test (Lagrange multipliers): the residual is regressed on them besides Φ.

The motion of one record at the rate at which causes of model error are compared.

Model error lies below the highest frequency of the motion, so samples at twenty-five times that
frequency are enough to evaluate torques on. What a cause would add to the torque is a derivative of
the model: along a change of the motion (an encoder that is off), of the robot (a length that is
off) or of the torque itself (a clock that is off).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from threading import Lock
from typing import Any, NoReturn

import numpy as np

from pivident.dynamics.regressor import Regressor
from pivident.estimation.problem import Problem
from pivident.foundation.errors import IdentificationError
from pivident.foundation.text.display import Displayed
from pivident.robot.description import Robot
from pivident.signals.bandpass import butterworth

#: Samples per period of the highest frequency of the motion, and where nothing but products of the
#: motion is asked for, whose frequencies are at most three times as high.
SAMPLES_PER_PERIOD, SMOOTH_SAMPLES_PER_PERIOD = 25.0, 10.0
#: Step of the differences: of positions [rad or m], of speeds, or relative.
STEP = 1e-6
#: Share of a joint's torque below which shapes that slow changes resemble are of no consequence.
NEGLIGIBLE = 0.005
#: Cut-off before samples are left out, over the rate of those that stay.
PASSED = 0.4


@dataclass(frozen=True, eq=False)
class Reach:
    """Travel, speeds and torques of the joints in all records, each of shape (joints,)."""

    low: np.ndarray  # least positions [rad or m]
    high: np.ndarray  # largest positions
    fastest: np.ndarray  # largest speeds [rad/s or m/s]
    strongest: np.ndarray  # largest torques [N m or N]
    pace: np.ndarray  # rms acceleration over rms speed: the ω of a sine [rad/s]


@dataclass(frozen=True, eq=False)
class RecordMotion:
    """Positions, speeds and accelerations of a record, time **last**, with the model's torques.

    ``regressor`` and ``theta`` are the model, ``number`` is that of the record, ``rate`` the one
    of these samples [Hz].
    """

    regressor: Regressor
    theta: np.ndarray  # shape (parameters,)
    q: np.ndarray  # positions [rad or m], shape (joints, samples); ``dq ddq`` likewise
    dq: np.ndarray
    ddq: np.ndarray
    rate: float
    number: int
    start: float = 0.0  # time of the first sample since the first record began [s]

    @property
    def robot(self) -> Robot:
        """The robot of the model."""
        return self.regressor.robot

    @property
    def seconds(self) -> np.ndarray:
        """Time of each sample since the first record began, shape (samples,) [s]."""
        return self.start + np.arange(self.q.shape[1]) / self.rate

    @cached_property
    def torque(self) -> np.ndarray:
        """Φθ, shape (joints, samples) [N m or N]."""
        return self.torque_at(self.q, self.dq, self.ddq)

    @cached_property
    def load(self) -> np.ndarray:
        """Torque of inertia, gravity and springs alone: what the joints carry, likewise."""
        theta = np.where([p.carries_load for p in self.regressor.parameters], self.theta, 0.0)
        return self.regressor.torque(self.q.T, self.dq.T, self.ddq.T, theta).T

    @cached_property
    def transmitted(self) -> np.ndarray:
        """Torque that the gears transmit to the links: the load without that of the rotors."""
        return self.transmitted_at(self.q, self.dq, self.ddq)

    def torque_at(self, q: np.ndarray, dq: np.ndarray, ddq: np.ndarray) -> np.ndarray:
        """Φθ on another motion, shape (joints, samples)."""
        return self.regressor.torque(q.T, dq.T, ddq.T, self.theta).T

    def transmitted_at(self, q: np.ndarray, dq: np.ndarray, ddq: np.ndarray) -> np.ndarray:
        """The same without friction, offsets, ripple and rotors, as far as these stand alone."""
        own = [p.carries_load and p.stem not in ("ia", "iam") for p in self.regressor.parameters]
        return self.regressor.torque(q.T, dq.T, ddq.T, np.where(own, self.theta, 0.0)).T

    def torque_by(self, regressor: Regressor) -> np.ndarray:
        """Torque of the same parameters in another robot, shape (joints, samples).

        What the change of the groups of parameters would add lies in the space of Φ.
        """
        if regressor not in self._torques:
            tau = regressor.torque(self.q.T, self.dq.T, self.ddq.T, self.theta)
            self._torques[regressor] = tau.T
        return self._torques[regressor]

    @cached_property
    def _torques(self) -> dict[Regressor, np.ndarray]:
        """Torques in other robots made so far: causes of several changes share them."""
        return {}

    def derivative(self, x: np.ndarray) -> np.ndarray:
        """Derivative by time of signals, time last."""
        return np.gradient(x, axis=-1) * self.rate

    def along(
        self,
        joint: int,
        change: tuple[np.ndarray, np.ndarray, np.ndarray],
        step: float,
        transmitted: bool = False,
    ) -> np.ndarray:
        """Derivative of the torque along a change of one joint's motion, shape (joints, samples).

        δτ = ∂τ/∂q δq + ∂τ/∂dq δdq + ∂τ/∂ddq δddq; friction with memory or load needs the path, and
        is asked along the whole change.

        ``change``: δq, δdq and δddq of the joint, shape (samples,) each; ``step``: size of the
        difference along it; ``transmitted``: of what the gears transmit alone.
        """
        if self.regressor.inner_entries.size:
            return self._difference(joint, change, step, transmitted)
        by_position, by_speed, by_acceleration = self._derivatives(joint, transmitted)
        return by_position * change[0] + by_speed * change[1] + by_acceleration * change[2]

    def transmitted_by_acceleration(self, joint: int) -> np.ndarray:
        """Inertia of a joint's links, ∂τ/∂ddq of what its gear transmits, shape (samples,)."""
        return np.asarray(self._derivatives(joint, transmitted=True)[2][joint])

    def _derivatives(
        self, joint: int, transmitted: bool
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """∂τ/∂q, ∂τ/∂dq and ∂τ/∂ddq of one joint, made once; shape (joints, samples) each."""
        with self._locks[joint]:
            if (joint, transmitted) not in self._known:
                one, none = np.ones(self.q.shape[1]), np.zeros(self.q.shape[1])
                by_position, by_speed, by_acceleration = (
                    self._difference(joint, change, step, transmitted)
                    for change, step in (
                        ((one, none, none), STEP),
                        ((none, one, none), STEP),
                        ((none, none, one), 1.0),  # linear
                    )
                )
                self._known[joint, transmitted] = by_position, by_speed, by_acceleration
            return self._known[joint, transmitted]

    def _difference(
        self,
        joint: int,
        change: tuple[np.ndarray, np.ndarray, np.ndarray],
        step: float,
        transmitted: bool,
    ) -> np.ndarray:
        """(τ(motion + step · change) - τ(motion)) / step."""
        moved = []
        for signal, delta in zip((self.q, self.dq, self.ddq), change, strict=True):
            other = signal.copy()
            other[joint] += step * delta
            moved.append(other)
        if transmitted:
            return (self.transmitted_at(*moved) - self.transmitted) / step
        return (self.torque_at(*moved) - self.torque) / step

    @cached_property
    def _known(self) -> dict[tuple[int, bool], tuple[np.ndarray, np.ndarray, np.ndarray]]:
        """Derivatives made so far: of a joint, of the whole torque or of what gears transmit."""
        return {}

    @cached_property
    def _locks(self) -> list[Lock]:
        """One for each joint."""
        return [Lock() for _ in range(len(self.q))]

    def every(self, stride: int) -> RecordMotion:
        """The motion at a fraction of the rate."""
        if stride == 1:
            return self
        q, dq, ddq = (thinned(x, self.rate, stride) for x in (self.q, self.dq, self.ddq))
        return RecordMotion(
            self.regressor, self.theta, q, dq, ddq, self.rate / stride, self.number, self.start
        )


def thinned(x: np.ndarray, rate: float, stride: int) -> np.ndarray:
    """Every so many samples behind a low-pass that leaves the band alone; time last."""
    if stride > 1:  # accelerations are noisy where a motion has long ended
        x = butterworth(x.T, rate, PASSED * rate / stride)[::stride].T
    return np.ascontiguousarray(x)


def stride_of(rate: float, band: float) -> int:
    """Every so many samples of a record at a rate [Hz] are enough for a band [Hz]."""
    return max(1, int(rate / (SAMPLES_PER_PERIOD * band)))


#: Columns of a cause on the motion of a record, shape (columns, joints, samples).
Columns = Callable[[RecordMotion], np.ndarray]
#: A problem without a cause of some size, shape (columns,).
Correction = Callable[[Problem, np.ndarray], Problem]


@dataclass(frozen=True, eq=False)
class Cause(Displayed):
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
            measured motion: those of the motion of the instruments then stand for them.
        least: share of the residual, fitted and on blocks that were not, from which on it is named.
        least_torque: share of a joint's torque from which on it is named.
        by_effect: whether one below is named, too, if it moves the estimate out of its intervals.
        phrase: the cause in words with ``{size}`` in its place; empty: subject, what and size.
        parts: name and unit of each column, where they have their own.
        reference: temperature where its torque is zero [°C or K]; None: it is of no temperature.
        instant: when it began, since the first record did [s]; None: it has no instant.
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
    by_effect: bool = False
    phrase: str = ""
    parts: tuple[tuple[str, str], ...] = ()
    reference: float | None = None
    instant: float | None = None

    def allows(self, size: np.ndarray) -> bool:
        """Whether a size, shape (columns,), makes sense."""
        return self.smallest <= float(np.linalg.norm(size)) < self.largest and not (
            self.is_positive and float(size[0]) < 0.0
        )

    def __str__(self) -> str:
        return f"{self.kind}{' of ' * bool(self.subject)}{self.subject}: {self.what}"

    def __getstate__(self) -> dict[str, Any]:
        """What another process gets: all but the functions, which only this one can call."""
        correct = None if self.correct is None else _left_behind
        return vars(self) | {"columns": _left_behind, "correct": correct}


def _left_behind(*_: object) -> NoReturn:
    """In place of the functions of a cause that came from another process or a file."""
    raise IdentificationError(
        "the functions of this cause of model error stayed in the process that tested for it",
        advice="test for it again here, named_causes(problem, result)",
    )


def on_joint(joint: int, signals: list[np.ndarray], motion: RecordMotion) -> np.ndarray:
    """Torques on one joint alone, shape (columns, joints, samples); each (samples,)."""
    out = np.zeros((len(signals), *motion.q.shape))
    out[:, joint] = signals
    return out
