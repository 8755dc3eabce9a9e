"""Frames: rotations, poses and the rule that makes a joint's axis the z axis."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

#: Distance from ±z below which an axis counts as exactly ±z.
AXIS_TOLERANCE = 1e-12


@dataclass(frozen=True, eq=False)
class Pose:
    """Pose of a frame in another: ^a x = rotation (3, 3) · ^b x + translation (3,) [m]."""

    rotation: np.ndarray
    translation: np.ndarray

    @classmethod
    def identity(cls) -> Pose:
        """The frame itself."""
        return cls(np.eye(3), np.zeros(3))

    def __matmul__(self, other: Pose) -> Pose:
        """^aT_c = ^aT_b · ^bT_c."""
        return Pose(
            self.rotation @ other.rotation, self.rotation @ other.translation + self.translation
        )


def rotation_about(axis: np.ndarray, angle: float) -> np.ndarray:
    """Rodrigues: R = 1 + sin(angle) K + (1 - cos(angle)) K², K = [axis]ₓ, axis a unit vector."""
    x, y, z = axis
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * cross @ cross


def rotation_x(angle: float) -> np.ndarray:
    """Rotation about x by ``angle`` [rad]."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])


def rotation_y(angle: float) -> np.ndarray:
    """Rotation about y by ``angle`` [rad]."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])


def rotation_z(angle: float) -> np.ndarray:
    """Rotation about z by ``angle`` [rad]."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def rotation_from_rpy(roll: float, pitch: float, yaw: float) -> np.ndarray:
    """Rz(yaw) · Ry(pitch) · Rx(roll), the convention of URDF [rad]."""
    return rotation_z(yaw) @ rotation_y(pitch) @ rotation_x(roll)


def rotation_from_z_to(axis: np.ndarray) -> np.ndarray:
    """The smallest rotation A with A · (0, 0, 1) = axis, a unit vector.

    It turns about z × axis by the angle between the two:

        A = 1 + K + K² / (1 + axis_z),    K = [z × axis]ₓ

    For axis = -z that direction is undefined and A is the half turn about x.
    """
    x, y, z = axis
    sine = np.hypot(x, y)
    if sine < AXIS_TOLERANCE:
        return np.eye(3) if z > 0.0 else np.diag([1.0, -1.0, -1.0])
    # (1 - cos) / sin² loses all digits near -z in the form above; unit axes do not.
    ux, uy = -y / sine, x / sine
    versine = 1.0 - z
    return np.array(
        [
            [z + versine * ux * ux, versine * ux * uy, x],
            [versine * ux * uy, z + versine * uy * uy, y],
            [-x, -y, z],
        ]
    )
