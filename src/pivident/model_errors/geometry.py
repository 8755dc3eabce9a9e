"""Geometry that is off: lengths and angles between joints, and the way up.

The frame of a joint in its parent's link has six coordinates, of which a turn about its own axis is
the zero position, see `motion_errors`. Columns are the derivative of Φθ by each, from torques of
the robot changed by a small step. Parameters whose groups change with the geometry take up what
lies in the space of Φ; what remains is seen by no other parameter.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import lru_cache

import numpy as np

from pivident.dynamics.regressor import Regressor
from pivident.dynamics.robot_regressor import regressor_of
from pivident.estimation.problem import Problem
from pivident.model_errors.cause import Cause
from pivident.model_errors.record_motion import RecordMotion
from pivident.robot.description import Robot

#: Size of one unit in which geometry is told: millimetres and degrees [m, rad].
MILLIMETRE, DEGREE = 1e-3, np.pi / 180.0

#: Steps of the differences [mm, °].
STEPS = {"mm": 1e-2, "°": 1e-3}

#: Largest sizes that are believed [mm, °].
LARGEST = {"mm": 50.0, "°": 5.0}

#: Direction of gravity beyond which a turn about an axis leaves it where it is.
UPRIGHT = 0.99

#: A robot changed by a length [m] or an angle [rad].
Change = Callable[[Robot, float], Robot]

AXES = "xyz"


def geometry_causes(robot: Robot) -> Iterator[Cause]:
    """Lengths and angles between the joints, and the direction of gravity."""
    # lengths and angles of closed loops are no free numbers
    for j, joint in enumerate(robot.joints if robot.constraints is None else ()):
        if joint.motion != "driven":
            continue  # a measured base is where it was measured
        base = "the base" if joint.parent < 0 else robot.joints[joint.parent].name
        way = f"from {base} to {joint.name}"
        for k, axis in enumerate(AXES):
            yield _cause(
                joint.name, f"correction of the length along {axis} {way}", "mm", _moved(j, k)
            )
        about = [_turned(j, k) for k in range(2)]
        for k, axis in enumerate(AXES[:2]):
            yield _cause(joint.name, f"correction of the angle about {axis} {way}", "°", about[k])
        yield _cause(joint.name, f"correction of the direction of its axis {way}", "°", *about)
    size = float(np.linalg.norm(robot.gravity))
    level = [k for k in range(3) if abs(robot.gravity[k]) < UPRIGHT * size]
    for k in level:
        what = f"correction of the angle of the base about {AXES[k]}"
        yield _cause("", what, "°", _tilted(k))
    if level:
        tilts = [_tilted(k) for k in level]
        yield _cause("", "correction of the direction of gravity", "°", *tilts)


def rotation(axis: int, angle: float) -> np.ndarray:
    """Rotation about a coordinate axis by an angle [rad], shape (3, 3)."""
    i, j = (axis + 1) % 3, (axis + 2) % 3
    turn = np.eye(3)
    turn[[i, j], [i, j]] = np.cos(angle)
    turn[i, j], turn[j, i] = -np.sin(angle), np.sin(angle)
    return turn


def _cause(subject: str, what: str, unit: str, *changes: Change) -> Cause:
    """A cause of one change of the robot, or of several together."""
    scale, step = (MILLIMETRE if unit == "mm" else DEGREE), STEPS[unit]

    @lru_cache(maxsize=1)
    def changed(regressor: Regressor) -> list[Regressor]:
        robots = [change(regressor.robot, step * scale) for change in changes]
        return [regressor_of(robot, regressor.parameters) for robot in robots]

    def columns(motion: RecordMotion) -> np.ndarray:
        after = [motion.torque_by(other) for other in changed(motion.regressor)]
        return (np.array(after) - motion.torque) / step

    def correct(problem: Problem, size: np.ndarray) -> Problem:
        robot = problem.robot
        for change, own in zip(changes, size, strict=True):
            robot = change(robot, float(own) * scale)
        return replace(problem, robot=robot)

    return Cause(
        "geometry",
        subject,
        what,
        unit,
        columns,
        len(changes),
        correct,
        LARGEST[unit],
        is_smooth=True,
    )


def _moved(joint: int, axis: int) -> Change:
    """The frame of a joint moved along an axis of its parent's link."""

    def change(robot: Robot, length: float) -> Robot:
        own = robot.joints[joint]
        translation = own.translation + length * np.eye(3)[axis]
        return _with_joint(robot, joint, replace(own, translation=translation))

    return change


def _turned(joint: int, axis: int) -> Change:
    """The frame of a joint turned about one of its own axes."""

    def change(robot: Robot, angle: float) -> Robot:
        own = robot.joints[joint]
        turned = own.rotation @ rotation(axis, angle)
        return _with_joint(robot, joint, replace(own, rotation=turned))

    return change


def _tilted(axis: int) -> Change:
    """Gravity turned about an axis of the base."""
    return lambda robot, angle: robot.with_gravity(rotation(axis, angle) @ robot.gravity)


def _with_joint(robot: Robot, index: int, joint) -> Robot:
    joints = list(robot.joints)
    joints[index] = joint
    return replace(robot, joints=tuple(joints))
