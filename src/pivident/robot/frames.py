"""Frames: rotations, poses and the rule that makes a joint's axis the z axis.

Files print angles with few digits. Axes that are parallel or perpendicular in the robot are then
a few microradians off, and each of them makes a base parameter that no motion determines. So
geometry within its printed precision is exact: an angle written as 1.57, 1.5707 or 1.5708 is a
quarter turn, and what such angles leave over in directions and lengths is zero.
"""

from __future__ import annotations

from dataclasses import dataclass
from decimal import Decimal
from math import pi
from typing import Annotated

import numpy as np

from pivident.foundation.text.plain_values import Sized

Vector3 = Annotated[np.ndarray, Sized(3)]
Matrix3 = Annotated[np.ndarray, Sized(3, 3)]

#: Distance from ±z below which an axis counts as exactly ±z.
AXIS_TOLERANCE = 1e-12

#: Elements of directions and angles [rad] below this are left over from rounded angles (3.1416:
#: 7e-6); no torque shows them. Those below ``AXIS_TOLERANCE`` are rounding of the arithmetic.
RESIDUE = 1e-5

#: Coarsest unit of the last printed digit of an angle from which a quarter turn is known [rad].
COARSEST = Decimal("0.01")


@dataclass(frozen=True, eq=False)
class Pose:
    """Pose of a frame in another: ^a x = rotation (3, 3) · ^b x + translation (3,) [m]."""

    rotation: Matrix3
    translation: Vector3

    @classmethod
    def identity(cls) -> Pose:
        """The frame itself."""
        return cls(np.eye(3), np.zeros(3))

    def __matmul__(self, other: Pose) -> Pose:
        """^aT_c = ^aT_b · ^bT_c."""
        return Pose(
            self.rotation @ other.rotation, self.rotation @ other.translation + self.translation
        )


def exact_angle(written: str | float) -> float:
    """An angle as a file writes it, or the quarter turns that it is rounded or cut off from [rad].

    Residues of rounded angles are zero.
    """
    angle, unit = float(written), Decimal(1).scaleb(int(Decimal(str(written)).as_tuple().exponent))
    turns = round(angle / (pi / 2)) * (pi / 2)
    short = abs(turns) - abs(angle)
    rounded = turns and unit <= COARSEST and -0.5 <= short / float(unit) < 1.0
    return turns if rounded or AXIS_TOLERANCE < abs(short) < RESIDUE else angle


def without_residues(pose: Pose, size: float) -> Pose:
    """The pose without what rounded angles left over, bit by bit the same where nothing is.

    They leave an axis along another one but for two small numbers, or two joints' axes
    perpendicular but for one. Another small number among large ones is the chance of a frame that
    stands askew.

    ``size``: largest length in the robot [m], of which residues of lengths are a share.
    """
    rotation, translation = pose.rotation, pose.translation
    for _ in range(40):  # each pass at least halves what is left; most end after the first
        small = np.abs(rotation) < RESIDUE
        along = (small.sum(axis=0) > 1) | (small.sum(axis=1)[:, None] > 1)
        along[2, 2] = True
        rest = residues(rotation, 1.0) & along
        if not rest.any():
            break
        rotation = np.where(rest, 0.0, rotation)
        rotation = 1.5 * rotation - 0.5 * rotation @ rotation.T @ rotation  # orthogonal again
    return Pose(rotation, np.where(residues(translation, min(size, 1.0)), 0.0, translation))


def residues(x: np.ndarray, scale: float) -> np.ndarray:
    """True where an element is neither zero up to rounding nor geometry."""
    return (np.abs(x) > AXIS_TOLERANCE * scale) & (np.abs(x) < RESIDUE * scale)


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
