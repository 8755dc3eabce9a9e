"""The motion of one record at the rate at which causes of model error are compared.

Model error lies below the highest frequency of the motion, so samples at twenty-five times that
frequency are enough to evaluate torques on. What a cause would add to the torque is a derivative of
the model: along a change of the motion (an encoder that is off), of the robot (a length that is
off) or of the torque itself (a clock that is off).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from pivident.dynamics.regressor import Regressor
from pivident.robot.description import Robot

#: Samples per period of the highest frequency of the motion.
SAMPLES_PER_PERIOD = 25.0


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
        return self.load_at(self.q, self.dq, self.ddq)

    def torque_at(self, q: np.ndarray, dq: np.ndarray, ddq: np.ndarray) -> np.ndarray:
        """Φθ on another motion, shape (joints, samples)."""
        return self.regressor.torque(q.T, dq.T, ddq.T, self.theta).T

    def load_at(self, q: np.ndarray, dq: np.ndarray, ddq: np.ndarray) -> np.ndarray:
        """The same without friction, offsets and ripple."""
        carried = [p.carries_load for p in self.regressor.parameters]
        return self.regressor.torque(q.T, dq.T, ddq.T, np.where(carried, self.theta, 0.0)).T

    def torque_by(self, regressor: Regressor) -> np.ndarray:
        """Torque of the same parameters in another robot, shape (joints, samples).

        What the change of the groups of parameters would add lies in the space of Φ.
        """
        return regressor.torque(self.q.T, self.dq.T, self.ddq.T, self.theta).T

    def derivative(self, x: np.ndarray) -> np.ndarray:
        """Derivative by time of signals, time last."""
        return np.gradient(x, axis=-1) * self.rate

    def along(
        self,
        joint: int,
        change: tuple[np.ndarray, np.ndarray, np.ndarray],
        step: float,
        load: bool = False,
    ) -> np.ndarray:
        """Derivative of the torque along a change of one joint's motion, shape (joints, samples).

        ``change``: δq, δdq and δddq of the joint, shape (samples,) each; ``step``: size of the
        difference; ``load``: of what the joints carry alone.
        """
        moved = []
        for signal, delta in zip((self.q, self.dq, self.ddq), change, strict=True):
            other = signal.copy()
            other[joint] += step * delta
            moved.append(other)
        after = self.load_at(*moved) if load else self.torque_at(*moved)
        return (after - (self.load if load else self.torque)) / step


def stride_of(rate: float, band: float) -> int:
    """Every so many samples of a record at a rate [Hz] are enough for a band [Hz]."""
    return max(1, int(rate / (SAMPLES_PER_PERIOD * band)))
