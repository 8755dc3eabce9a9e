"""Between motor side and joint side: reduction matrix, signs and drive gains, (P-7).

With N the reduction matrix (motor per joint, couplings off its diagonal),

    q_motor = N q,     tau = Nᵀ tau_motor,     tau_motor = drive_gain · command

so that the power is the same on both sides, tauᵀ dq = tau_motorᵀ dq_motor.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from pivident.foundation.errors import RobotDescriptionError
from pivident.foundation.scratch import working_array
from pivident.foundation.text.display import Displayed
from pivident.foundation.text.plain_values import Sized


@dataclass(frozen=True, eq=False)
class Transmission(Displayed):
    """Reduction and drive gains of all joints.

    Attributes:
        reduction: motor positions per joint positions, shape (joints, joints).
        drive_gain: motor torque per unit of command (N m/A, N m/V …), shape (joints,).
        position_offset: joint position of the model where the log reads zero [rad or m],
            shape (joints,): q_model = N⁻¹ q_motor + position_offset.
        gain_given: which drive gains somebody gave, shape (joints,); a gain that nobody gave is 1
            and turns no ampere into a torque. None: all of them.
    """

    reduction: Annotated[np.ndarray, Sized("joints", "joints")]
    drive_gain: Annotated[np.ndarray, Sized("joints")]
    position_offset: Annotated[np.ndarray, Sized("joints")]
    gain_given: Annotated[np.ndarray, Sized("joints", of=bool)] = None  # type: ignore[assignment]

    def __post_init__(self) -> None:
        n = len(self.drive_gain)
        if self.gain_given is None:
            object.__setattr__(self, "gain_given", np.ones(n, dtype=bool))
        if self.reduction.shape != (n, n) or self.position_offset.shape != (n,):
            raise RobotDescriptionError(
                f"transmission: reduction {self.reduction.shape}, drive gains {(n,)} and position "
                f"offsets {self.position_offset.shape} do not belong to the same joints"
            )
        for key in ("reduction", "drive_gain", "position_offset"):
            if not np.isfinite(getattr(self, key)).all():
                raise RobotDescriptionError(f"transmission: {key} holds NaN or infinite values")
        # Rows are scaled first: a lead screw turns thousands of radians per metre, a wrist one.
        largest = np.abs(self.reduction).max(axis=1, keepdims=True, initial=0.0)
        if (largest == 0.0).any() or abs(np.linalg.det(self.reduction / largest)) < 1e-9:
            raise RobotDescriptionError("transmission: the reduction matrix is singular")

    @classmethod
    def direct(cls, joints: int) -> Transmission:
        """No gear: motor side and joint side are the same.

        Args:
            joints: number of joints.

        Returns:
            Ratios of one, zero offsets.
        """
        return cls(np.eye(joints), np.ones(joints), np.zeros(joints), np.zeros(joints, dtype=bool))

    def first(self, joints: int) -> Transmission:
        """That of the first joints, for logs with fewer of them.

        Args:
            joints: how many, counted from the base.

        Returns:
            Itself where it has no more.
        """
        if joints >= len(self.drive_gain):
            return self
        n = slice(joints)
        return Transmission(
            self.reduction[n, n], self.drive_gain[n], self.position_offset[n], self.gain_given[n]
        )

    def behind(self, joints: int) -> Transmission:
        """That of the joints behind the first ones, which share no motor with them.

        Args:
            joints: how many are left out, counted from the base.
        """
        n = slice(joints, None)
        return Transmission(
            self.reduction[n, n], self.drive_gain[n], self.position_offset[n], self.gain_given[n]
        )

    def joint_positions(self, motor_positions: np.ndarray) -> np.ndarray:
        """Joint positions q = N⁻¹ q_motor + offset, shape (samples, joints) [rad or m].

        Args:
            motor_positions: shape (samples, joints) [rad or m on the motor side].
        """
        q = _product(motor_positions, np.linalg.inv(self.reduction).T)
        return np.add(q, self.position_offset, out=q)

    def motor_positions(self, q: np.ndarray) -> np.ndarray:
        """Motor positions q_motor = N (q - offset), shape (samples, joints) [rad or m]."""
        return (q - self.position_offset) @ self.reduction.T

    def joint_torques(self, motor_torques: np.ndarray) -> np.ndarray:
        """Joint torques tau = Nᵀ tau_motor, shape (samples, joints) [N m or N].

        Args:
            motor_torques: shape (samples, joints) [N m or N on the motor side].
        """
        return _product(motor_torques, self.reduction)

    def motor_torques(self, tau: np.ndarray) -> np.ndarray:
        """Motor torques tau_motor = N⁻ᵀ tau, shape (samples, joints) [N m or N]."""
        return tau @ np.linalg.inv(self.reduction)


def _product(signal: np.ndarray, matrix: np.ndarray) -> np.ndarray:
    """A signal (samples, joints) times a matrix, in a working array."""
    signal = np.asarray(signal, dtype=float)
    return np.matmul(signal, matrix, out=working_array(signal.shape))
