"""Speeds at which a joint stands still, for an observation matrix with friction in it.

At standstill dry friction takes any value up to its level, and no law of it holds. The motor of a
coupling rubs with its own speed v = dq_motor + ratio·dq_joint, in the torques of both joints: where
it stands still, neither joint's torque can be told, however fast the two move.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pivident.robot.description import Coupling


@dataclass(frozen=True, eq=False)
class SpeedLimits:
    """Speeds below which samples are excluded.

    Attributes:
        joints: by joint, shape (joints,) [rad/s or m/s]; zero: all samples count.
        couplings: motors that rub with the speeds of two joints; their limit is that of ``motor``.
    """

    joints: np.ndarray
    couplings: Sequence[Coupling] = ()

    def moving(self, dq: np.ndarray) -> np.ndarray:
        """Samples faster than the limits, shape (joints, samples), for speeds ``dq`` like it."""
        limits = self.joints[:, None]
        moving = (np.abs(dq) > limits) | (limits == 0.0)
        for c in self.couplings:
            if c.coulomb and self.joints[c.motor] > 0.0:
                motor = np.abs(dq[c.motor] + c.ratio * dq[c.joint]) > self.joints[c.motor]
                moving[[c.motor, c.joint]] &= motor
        return moving
