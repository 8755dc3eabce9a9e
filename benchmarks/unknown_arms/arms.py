"""Four arms that pivident has never seen: geometry, drawings of the bodies, drives, friction.

Everything here is the *drawing*. A machine made from it (`truth.machine`) differs by its seed, and
so does the URDF that a user gets with it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class JointPlace:
    """A joint as a URDF describes it.

    Attributes:
        name: name of the joint; its link is called ``NAME_link``.
        kind: ``revolute`` or ``prismatic``.
        xyz: origin in the link before it [m].
        rpy: roll, pitch and yaw of its frame [rad].
        axis: of the joint in its frame.
        limits: lowest and highest position [rad or m].
        speed: rated speed [rad/s or m/s].
        effort: largest torque or force [N m or N].
    """

    name: str
    kind: str
    xyz: tuple[float, float, float]
    rpy: tuple[float, float, float]
    axis: tuple[float, float, float]
    limits: tuple[float, float]
    speed: float
    effort: float


@dataclass(frozen=True)
class Box:
    """A body as drawn: a uniform box of mass [kg] with centre [m] and edges [m]."""

    mass: float
    center: tuple[float, float, float]
    edges: tuple[float, float, float]


@dataclass(frozen=True)
class Shaft:
    """A motor that turns with two joints: its speed is dq_motor + ratio · dq_joint.

    Attributes:
        motor: index of the joint that the motor drives, on whose side the values are.
        joint: index of the joint that turns it as well.
        ratio: speed per speed of ``joint``.
        inertia: of the rotor [kg m² or kg].
        viscous: friction of the motor per speed.
        coulomb: dry friction of the motor.
    """

    motor: int
    joint: int
    ratio: float
    inertia: float
    viscous: float
    coulomb: float


@dataclass(frozen=True)
class Arm:
    """The drawing of an arm, its drives, its log and the room in which it moves.

    Attributes:
        name: name of the arm.
        joints: joints from the base outwards.
        boxes: body of each joint's link.
        rotor: rotor inertias on the joint side [kg m² or kg].
        viscous: friction per speed [N m s/rad or N s/m], motor and bearings together.
        coulomb: dry friction [N m or N], likewise.
        bearing_share: share of the friction that acts behind the torque sensor; 1: no sensor.
        torque_constant: of the motors [N m/A], empty where torques are logged.
        gear_ratio: motor speed per joint speed.
        shafts: motors that turn with two joints.
        home: middle of the motion [rad or m].
        reach: largest distance from it [rad or m].
        counts: encoder counts per radian or metre on the joint side.
        encoder_noise: standard deviation of the measured position [rad or m].
        torque_noise: standard deviation of the logged torque [A, N m or N].
        frequencies: lowest and highest frequency of the users' sines [Hz].
    """

    name: str
    joints: tuple[JointPlace, ...]
    boxes: tuple[Box, ...]
    rotor: tuple[float, ...]
    viscous: tuple[float, ...]
    coulomb: tuple[float, ...]
    bearing_share: float
    torque_constant: tuple[float, ...]
    gear_ratio: tuple[float, ...]
    shafts: tuple[Shaft, ...]
    home: tuple[float, ...]
    reach: tuple[float, ...]
    counts: tuple[float, ...]
    encoder_noise: tuple[float, ...]
    torque_noise: tuple[float, ...]
    frequencies: tuple[float, float]

    @property
    def size(self) -> int:
        """Number of joints."""
        return len(self.joints)

    @property
    def speeds(self) -> np.ndarray:
        """Rated speeds [rad/s or m/s]."""
        return np.array([joint.speed for joint in self.joints])

    @property
    def efforts(self) -> np.ndarray:
        """Largest torques [N m or N]."""
        return np.array([joint.effort for joint in self.joints])


_X, _Y, _Z, _DOWN = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (0.0, 0.0, -1.0)
_NONE = (0.0, 0.0, 0.0)
_TURN, _BACK = (np.pi / 2, 0.0, 0.0), (-np.pi / 2, 0.0, 0.0)


def _revolute(name, xyz, axis, limit, speed, effort, rpy=_NONE):
    return JointPlace(name, "revolute", xyz, rpy, axis, (-limit, limit), speed, effort)


COBOT6 = Arm(
    name="cobot6",
    joints=(
        _revolute("base_joint", (0.0, 0.0, 0.18), _Z, 6.28, 2.09, 330.0),
        _revolute("shoulder_joint", (0.0, 0.17, 0.0), _Y, 6.28, 2.09, 330.0),
        _revolute("elbow_joint", (0.0, -0.14, 0.61), _Y, 3.1, 3.14, 150.0),
        _revolute("wrist1_joint", (0.0, 0.0, 0.57), _Y, 6.28, 3.14, 56.0),
        _revolute("wrist2_joint", (0.0, 0.12, 0.0), _Z, 6.28, 3.14, 56.0),
        _revolute("wrist3_joint", (0.0, 0.0, 0.11), _Y, 6.28, 3.14, 56.0),
    ),
    boxes=(
        Box(7.2, (0.0, 0.03, -0.01), (0.16, 0.20, 0.18)),
        Box(12.5, (0.0, 0.01, 0.25), (0.14, 0.15, 0.72)),
        Box(4.1, (0.0, 0.02, 0.27), (0.10, 0.11, 0.64)),
        Box(2.0, (0.0, 0.08, 0.01), (0.09, 0.13, 0.10)),
        Box(1.9, (0.0, 0.01, 0.08), (0.09, 0.10, 0.13)),
        Box(0.9, (0.02, 0.05, 0.01), (0.08, 0.09, 0.07)),
    ),
    rotor=(3.1, 3.1, 1.5, 0.38, 0.38, 0.36),
    viscous=(13.0, 15.0, 9.0, 2.4, 2.2, 1.9),
    coulomb=(9.0, 11.0, 6.0, 1.9, 1.7, 1.5),
    bearing_share=1.0,
    torque_constant=(0.135, 0.135, 0.109, 0.092, 0.092, 0.092),
    gear_ratio=(101.0,) * 6,
    shafts=(),
    home=(0.2, -0.4, 1.1, 0.7, 0.5, -0.3),
    reach=(1.8, 0.8, 1.0, 1.4, 1.5, 2.2),
    counts=(2**21 / (2 * np.pi),) * 6,
    encoder_noise=(3e-6,) * 6,
    torque_noise=(0.06, 0.06, 0.05, 0.03, 0.03, 0.03),
    frequencies=(0.06, 0.6),
)

LINK7 = Arm(
    name="link7",
    joints=(
        _revolute("joint1", (0.0, 0.0, 0.33), _Z, 2.9, 2.2, 90.0),
        _revolute("joint2", _NONE, _Z, 1.8, 2.2, 90.0, rpy=_BACK),
        _revolute("joint3", (0.0, -0.32, 0.0), _Z, 2.9, 2.2, 90.0, rpy=_TURN),
        _revolute("joint4", (0.08, 0.0, 0.0), _Z, 3.0, 2.2, 90.0, rpy=_TURN),
        _revolute("joint5", (-0.08, 0.38, 0.0), _Z, 2.9, 2.6, 14.0, rpy=_BACK),
        _revolute("joint6", _NONE, _Z, 3.7, 2.6, 14.0, rpy=_TURN),
        _revolute("joint7", (0.09, 0.0, 0.0), _Z, 2.9, 2.6, 14.0, rpy=_TURN),
    ),
    boxes=(
        Box(4.6, (0.0, -0.03, -0.07), (0.12, 0.14, 0.26)),
        Box(3.4, (0.0, -0.10, 0.03), (0.11, 0.26, 0.13)),
        Box(3.1, (0.03, 0.02, -0.06), (0.13, 0.11, 0.20)),
        Box(3.0, (-0.04, 0.10, 0.02), (0.12, 0.26, 0.11)),
        Box(2.6, (0.0, 0.03, -0.10), (0.10, 0.12, 0.28)),
        Box(1.5, (0.06, 0.0, 0.0), (0.13, 0.10, 0.10)),
        Box(0.9, (0.01, 0.0, 0.08), (0.09, 0.08, 0.11)),
    ),
    rotor=(1.2, 1.2, 0.8, 0.8, 0.30, 0.26, 0.2),
    viscous=(5.0, 5.0, 3.6, 3.6, 1.4, 1.2, 0.9),
    coulomb=(3.6, 3.6, 2.8, 2.8, 1.2, 1.0, 0.8),
    bearing_share=0.15,
    torque_constant=(),
    gear_ratio=(100.0,) * 7,
    shafts=(),
    home=(0.1, 0.3, -0.2, -1.6, 0.2, 1.4, 0.1),
    reach=(1.6, 0.8, 1.4, 0.9, 1.6, 1.1, 1.8),
    counts=(2**20 / (2 * np.pi),) * 7,
    encoder_noise=(5e-6,) * 7,
    torque_noise=(0.10, 0.12, 0.08, 0.08, 0.03, 0.03, 0.02),
    frequencies=(0.06, 0.8),
)

#: Lead of the ball screw: travel per radian of its nut [m/rad].
LEAD = 0.02 / (2 * np.pi)

SCARA = Arm(
    name="scara",
    joints=(
        _revolute("J1", (0.0, 0.0, 0.30), _Z, 2.4, 7.5, 250.0),
        _revolute("J2", (0.35, 0.0, 0.04), _Z, 2.6, 11.0, 110.0),
        JointPlace("J3", "prismatic", (0.30, 0.0, 0.0), _NONE, _DOWN, (0.0, 0.21), 1.1, 350.0),
        _revolute("J4", _NONE, _DOWN, 6.3, 25.0, 9.0),
    ),
    boxes=(
        Box(11.0, (0.16, 0.0, 0.03), (0.46, 0.18, 0.12)),
        Box(8.5, (0.13, 0.0, 0.06), (0.42, 0.16, 0.18)),
        Box(0.9, (0.0, 0.0, 0.02), (0.03, 0.03, 0.40)),
        Box(1.4, (0.01, 0.004, 0.16), (0.08, 0.06, 0.10)),
    ),
    rotor=(0.77, 0.125, 0.0, 0.004),
    viscous=(8.0, 4.0, 25.0, 0.05),
    coulomb=(6.0, 4.0, 8.0, 0.15),
    bearing_share=1.0,
    torque_constant=(),
    gear_ratio=(80.0, 50.0, 1.0 / LEAD, 45.0),
    shafts=(Shaft(motor=2, joint=3, ratio=LEAD, inertia=1.95, viscous=18.0, coulomb=6.0),),
    home=(0.2, 0.6, 0.10, 0.0),
    reach=(1.4, 1.3, 0.09, 3.0),
    counts=(80 * 2**17 / (2 * np.pi), 50 * 2**17 / (2 * np.pi), 2**17 / 0.02, 2**20 / (2 * np.pi)),
    encoder_noise=(1.5e-6, 2e-6, 4e-7, 1e-5),
    torque_noise=(0.5, 0.25, 1.0, 0.02),
    frequencies=(0.2, 2.0),
)

TELESCOPE = Arm(
    name="telescope",
    joints=(
        _revolute("turn", (0.0, 0.0, 0.40), _Z, 2.9, 2.5, 300.0),
        _revolute("tilt", (0.10, 0.0, 0.25), _Y, 1.2, 2.0, 400.0),
        JointPlace("slide", "prismatic", (0.45, 0.0, 0.0), _NONE, _X, (0.0, 0.6), 0.9, 900.0),
        _revolute("pitch", (0.40, 0.0, 0.0), _Y, 2.0, 3.5, 60.0),
        _revolute("roll", (0.12, 0.0, 0.03), _X, 6.2, 5.0, 25.0),
    ),
    boxes=(
        Box(14.0, (0.03, 0.0, 0.10), (0.22, 0.20, 0.30)),
        Box(11.0, (0.20, 0.0, 0.02), (0.70, 0.14, 0.16)),
        Box(5.2, (0.05, 0.0, 0.01), (0.80, 0.08, 0.09)),
        Box(2.1, (0.05, 0.01, 0.02), (0.16, 0.09, 0.11)),
        Box(1.1, (0.04, 0.01, 0.03), (0.10, 0.08, 0.07)),
    ),
    rotor=(1.6, 1.9, 14.0, 0.16, 0.05),
    viscous=(9.0, 10.0, 60.0, 1.4, 0.6),
    coulomb=(7.0, 8.0, 25.0, 1.1, 0.5),
    bearing_share=1.0,
    torque_constant=(),
    gear_ratio=(100.0, 100.0, 400.0, 80.0, 50.0),
    shafts=(),
    home=(0.1, 0.2, 0.30, -0.4, 0.2),
    reach=(1.8, 0.6, 0.26, 1.2, 2.5),
    counts=(*(2**20 / (2 * np.pi),) * 2, 2e6, *(2**20 / (2 * np.pi),) * 2),
    encoder_noise=(3e-6, 3e-6, 6e-7, 5e-6, 8e-6),
    torque_noise=(0.3, 0.3, 1.0, 0.06, 0.03),
    frequencies=(0.08, 0.9),
)

#: Arms whose logs a new user gets, and all of them.
ARMS = {arm.name: arm for arm in (COBOT6, LINK7, SCARA)}
DRAWINGS = {**ARMS, TELESCOPE.name: TELESCOPE}
