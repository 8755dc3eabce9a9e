"""Joint torques that a measured wrench stands for, J(q)ᵀ f.

With the force F and the moment M of the sensor in the world, its origin p, and the axis a_i and
origin o_i of a joint on the way from the base to the link,

    revolute:   a_i · (M + (p - o_i) × F)
    prismatic:  a_i · F
"""

from __future__ import annotations

import numpy as np

from pivident.errors import RobotDescriptionError
from pivident.robot.description import Robot
from pivident.robot.wrench_sensor import BASE, WrenchSensor

#: Samples that are taken at a time.
BLOCK = 8192


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
