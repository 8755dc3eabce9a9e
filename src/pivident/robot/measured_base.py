"""A base that is measured, held by a force sensor or floating, and what its wrench does to joints.

Between the world and the base link stand six joints without motors,

    base_x base_y base_z base_roll base_pitch base_yaw,    ^world R = Rx(roll) · Ry(pitch) · Rz(yaw)

Their rows of the dynamic model are the force and the moment on the base. On a held base they stay
at zero: the rows are six equations without friction, and what they equal is the wrench of the
sensor under the base. A floating base has no other force than those of measured wrenches.

Joint torques that a measured wrench stands for, J(q)ᵀ f.

With the force F and the moment M of the sensor in the world, its origin p, and the axis a_i and
origin o_i of a joint on the way from the base to the link,

    revolute:   a_i · (M + (p - o_i) × F)
    prismatic:  a_i · F
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pivident.foundation.errors import RobotDescriptionError
from pivident.robot.description import Joint, JointKind, JointMotion, Link, Robot
from pivident.robot.frames import rotation_from_rpy, rotation_from_z_to
from pivident.robot.friction import FrictionLaw
from pivident.robot.transmission import Transmission
from pivident.robot.wrench_sensor import BASE, WrenchSensor

#: Names of the joints of a measured base, in their order.
BASE_JOINTS = ("base_x", "base_y", "base_z", "base_roll", "base_pitch", "base_yaw")
#: How near base_pitch may come to a right angle, where roll and yaw are the same turn [rad].
PITCH_MARGIN = 0.1
#: Samples that are taken at a time.
BLOCK = 8192


def with_held_base(robot: Robot, link: Link | None = None) -> Robot:
    """A robot that stands on a force sensor.

    Args:
        robot: the robot on a fixed base.
        link: what is between the sensor and the first joint, its inertia in the base frame; None:
            a body called ``base`` that nothing is known of.

    Returns:
        The robot with the six joints of its base in front of its own.

    Raises:
        RobotDescriptionError: the robot has closed loops or a measured base already.
    """
    return _with_base(robot, "held", link or Link("base"))


def with_floating_base(robot: Robot, link: Link | None = None) -> Robot:
    """A robot whose base moves, and is measured: suspended, or standing on measured feet.

    Args:
        robot: the robot as if its base were fixed, gravity in the frame of the world.
        link: the base, its inertia in the base frame; None: a body called ``base`` that nothing is
            known of.

    Returns:
        The robot with the six joints of its base in front of its own.

    Raises:
        RobotDescriptionError: the robot has closed loops or a measured base already.
    """
    return _with_base(robot, "measured", link or Link("base"))


def sensor_link(robot: Robot, sensor: WrenchSensor) -> int:
    """Index of the link that a sensor's wrench acts on.

    Args:
        robot: the robot.
        sensor: the sensor; ``base`` is the link of a measured base.

    Raises:
        RobotDescriptionError: there is no such link.
    """
    if sensor.link == BASE and robot.base_joints:
        return robot.base_joints - 1
    try:
        return robot.link_index(sensor.link)
    except RobotDescriptionError as error:
        raise RobotDescriptionError.of_part(f"wrench sensor {sensor.name!r}: ", error) from None


def wrench_torques(
    robot: Robot, sensor: WrenchSensor, q: np.ndarray, wrench: np.ndarray
) -> np.ndarray:
    """Jᵀ f of one sensor.

    Args:
        robot: a tree.
        sensor: where the wrench is measured.
        q: positions of all joints, shape (samples, joints) [rad or m].
        wrench: force and moment as measured, shape (samples, 6) [N, N m].

    Returns:
        Torques of the joints, shape (samples, joints) [N m or N].

    Raises:
        RobotDescriptionError: the robot has no such link.
    """
    link = sensor_link(robot, sensor)
    torques = np.zeros((len(q), robot.size))
    for first in range(0, len(q), BLOCK):
        span = slice(first, first + BLOCK)
        torques[span] = _torques(robot, sensor, link, q[span], wrench[span])
    return sensor.sign * torques


def _torques(
    robot: Robot, sensor: WrenchSensor, link: int, q: np.ndarray, wrench: np.ndarray
) -> np.ndarray:
    """Jᵀ f of some samples."""
    chain = robot.ancestors(link)[::-1]
    rotation, origin = np.broadcast_to(np.eye(3), (len(q), 3, 3)), np.zeros((len(q), 3))
    axes, origins = [], []
    for i in chain:
        rotation, origin = _behind(robot, i, q[:, i], rotation, origin)
        axes.append(rotation[:, :, 2])
        origins.append(origin)
    point = origin + rotation @ sensor.frame.translation
    rotation = rotation @ sensor.frame.rotation
    parts = wrench[:, :3], wrench[:, 3:]
    force, moment = (np.einsum("sij,sj->si", rotation, part) for part in parts)
    torques = np.zeros((len(q), robot.size))
    for i, axis, origin in zip(chain, axes, origins, strict=True):
        if robot.joints[i].kind == "prismatic":
            effect = force
        else:
            effect = moment + np.cross(point - origin, force)
        torques[:, i] = np.einsum("si,si->s", axis, effect)
    return torques


def link_places(robot: Robot, link: int, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Axes of a link in the world, shape (samples, 3, 3), and its origin, shape (samples, 3) [m].

    Args:
        robot: a tree.
        link: index of the link.
        q: positions of all joints, shape (samples, joints) [rad or m].
    """
    rotation, origin = np.broadcast_to(np.eye(3), (len(q), 3, 3)), np.zeros((len(q), 3))
    for i in robot.ancestors(link)[::-1]:
        rotation, origin = _behind(robot, i, q[:, i], rotation, origin)
    return rotation, origin


def _behind(
    robot: Robot, i: int, position: np.ndarray, rotation: np.ndarray, origin: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Axes and origin of link i from those of its parent."""
    joint = robot.joints[i]
    origin = origin + rotation @ joint.translation
    rotation = rotation @ joint.rotation
    if joint.kind == "prismatic":
        return rotation, origin + position[:, None] * rotation[:, :, 2]
    return rotation @ _turns(position), origin


def _turns(angle: np.ndarray) -> np.ndarray:
    """Rz of each angle, shape (samples, 3, 3)."""
    c, s, zero, one = np.cos(angle), np.sin(angle), np.zeros_like(angle), np.ones_like(angle)
    return np.moveaxis(np.array([[c, -s, zero], [s, c, zero], [zero, zero, one]]), 2, 0)


def with_wrench_sensors(robot: Robot, sensors: Sequence[WrenchSensor]) -> Robot:
    """A robot with force sensors; one under a base that is fixed makes it a held base.

    Args:
        robot: the robot.
        sensors: its sensors; their link is one of the robot's, or ``base``.

    Returns:
        The robot, whose recordings have to hold the wrenches.

    Raises:
        RobotDescriptionError: a name twice, a link that the robot does not have, closed loops.
    """
    names = [sensor.name for sensor in sensors]
    if len(set(names)) != len(names):
        raise RobotDescriptionError(
            f"names of wrench sensors: {', '.join(names)}", advice="each once"
        )
    if robot.constraints is not None and sensors:
        raise RobotDescriptionError(
            f"robot {robot.name!r} has closed loops, and measured wrenches on such mechanisms are "
            "not handled yet",
            advice="leave them out, where they are small",
        )
    under_base = any(sensor.link == BASE for sensor in sensors)
    if under_base and not robot.base_joints and BASE not in [link.name for link in robot.links]:
        robot = with_held_base(robot)
    for sensor in sensors:
        sensor_link(robot, sensor)
    return replace(robot, sensors=tuple(sensors))


def _with_base(robot: Robot, motion: JointMotion, link: Link) -> Robot:
    """Six joints before those of the robot, the last of them carries the base link."""
    if robot.constraints is not None or robot.base_joints:
        what = "a measured base already" if robot.base_joints else "closed loops"
        raise RobotDescriptionError(
            f"robot {robot.name!r} has {what}",
            advice="give a tree on a fixed base to measure the base of",
        )
    names = {*robot.joint_names, *(own.name for own in robot.links)}
    taken = names.intersection({link.name, *BASE_JOINTS})
    if taken:
        raise RobotDescriptionError(
            f"robot {robot.name!r}: {sorted(taken)[0]!r} is the name of a joint or link, and of a "
            "part of its measured base",
            advice="rename it",
        )
    axes = [rotation_from_z_to(axis) for axis in np.eye(3)] * 2
    before = np.eye(3)
    joints, links = [], []
    for i, (name, axis) in enumerate(zip(BASE_JOINTS, axes, strict=True)):
        kind: JointKind = "prismatic" if i < 3 else "revolute"
        joints.append(
            Joint(
                name,
                kind,
                i - 1,
                before.T @ axis,
                np.zeros(3),
                friction=FrictionLaw(()),
                motion=motion,
            )
        )
        links.append(Link(f"{name} axis", is_body=False))
        before = axis
    links[-1] = link
    count = len(joints)
    own = robot.transmission
    reduction = np.eye(count + robot.size)
    reduction[count:, count:] = own.reduction
    return replace(
        robot,
        joints=(
            *joints,
            *(
                replace(j, parent=count + j.parent if j.parent >= 0 else count - 1)
                for j in robot.joints
            ),
        ),
        links=(*links, *robot.links),
        rotor_inertia=np.concatenate([np.zeros(count), robot.rotor_inertia]),
        transmission=Transmission(
            reduction,
            np.concatenate([np.ones(count), own.drive_gain]),
            np.concatenate([np.zeros(count), own.position_offset]),
            np.concatenate([np.ones(count, bool), own.gain_given]),
        ),
        couplings=tuple(
            replace(c, motor=c.motor + count, joint=c.joint + count) for c in robot.couplings
        ),
    )


def base_positions(position: np.ndarray, rotation: np.ndarray) -> np.ndarray:
    """Positions of the joints of a floating base from its measured pose, without jumps of 2π.

    R = Rx(roll) Ry(pitch) Rz(yaw):  pitch = asin R_13,  roll = atan2(-R_23, R_33),
    yaw = atan2(-R_12, R_11).

    Args:
        position: origin of the base link in the world, shape (samples, 3) [m].
        rotation: its axes in the world, shape (samples, 3, 3).

    Returns:
        Positions, shape (samples, 6) [m, rad].

    Raises:
        RobotDescriptionError: the base comes near a pitch of a right angle; names the sample.
    """
    pitch = np.arcsin(np.clip(rotation[:, 0, 2], -1.0, 1.0))
    near = np.flatnonzero(np.abs(pitch) > np.pi / 2.0 - PITCH_MARGIN)
    if near.size:
        k = int(near[0])
        raise RobotDescriptionError(
            f"sample {k}: the base is pitched by {np.degrees(pitch[k]):.0f}°, and beyond "
            f"{np.degrees(np.pi / 2.0 - PITCH_MARGIN):.0f}° its roll and yaw cannot be told apart",
            advice="describe the robot with its base frame turned by a right angle",
        )
    roll = np.arctan2(-rotation[:, 1, 2], rotation[:, 2, 2])
    yaw = np.arctan2(-rotation[:, 0, 1], rotation[:, 0, 0])
    return np.column_stack([position, np.unwrap(roll), pitch, np.unwrap(yaw)])


def base_speeds(positions: np.ndarray, twist: np.ndarray) -> np.ndarray:
    """Speeds of the joints of a floating base from its measured twist.

    With the axes E = (x, Rx y, Rx Ry z) of roll, pitch and yaw in the world, ω = E d/dt (roll,
    pitch, yaw).

    Args:
        positions: of the joints of the base, shape (samples, 6) [m, rad].
        twist: speed of its origin and its angular velocity in the world, shape (samples, 6)
            [m/s, rad/s].

    Returns:
        Speeds, shape (samples, 6) [m/s, rad/s].
    """
    roll, pitch = positions[:, 3], positions[:, 4]
    cr, sr, cp, sp = np.cos(roll), np.sin(roll), np.cos(pitch), np.sin(pitch)
    zero, one = np.zeros_like(roll), np.ones_like(roll)
    axes = np.array([[one, zero, sp], [zero, cr, -sr * cp], [zero, sr, cr * cp]])
    turning = np.linalg.solve(np.moveaxis(axes, 2, 0), twist[:, 3:, None])[:, :, 0]
    return np.hstack([twist[:, :3], turning])


def rotations_from_quaternions(quaternion: np.ndarray) -> np.ndarray:
    """Rotation matrices of unit quaternions x y z w, shape (samples, 3, 3).

    Args:
        quaternion: shape (samples, 4); they may be off unit length by one percent.

    Raises:
        RobotDescriptionError: a quaternion is not of unit length; names the sample.
    """
    length = np.linalg.norm(quaternion, axis=1)
    off = np.flatnonzero(~(np.abs(length - 1.0) < 0.01))
    if off.size:
        k = int(off[0])
        raise RobotDescriptionError(
            f"sample {k}: the quaternion of the base has the length {length[k]:.4g} instead of 1",
            advice="its columns are x, y, z, w in this order",
        )
    x, y, z, w = (quaternion / length[:, None]).T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), 2, 0)


def continued_quaternions(quaternion: np.ndarray) -> np.ndarray:
    """Each with the sign that is nearer to the one before: q and -q are the same rotation.

    Args:
        quaternion: x y z w, shape (samples, 4).
    """
    turned = np.sum(quaternion[1:] * quaternion[:-1], axis=1) < 0.0
    signs = np.cumprod(np.where(turned, -1.0, 1.0))
    return quaternion * np.concatenate([[1.0], signs])[:, None]


def rotations_from_rpy(rpy: np.ndarray) -> np.ndarray:
    """Rotation matrices Rz(yaw) Ry(pitch) Rx(roll), shape (samples, 3, 3).

    Args:
        rpy: roll, pitch and yaw as URDF has them, shape (samples, 3) [rad].
    """
    return np.array([rotation_from_rpy(*own) for own in rpy]).reshape(-1, 3, 3)
