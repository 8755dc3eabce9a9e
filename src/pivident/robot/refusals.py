"""Refusals of robots by what does not handle them yet: loops, measured bases, measured wrenches."""

from __future__ import annotations

from pivident.foundation.errors import RobotDescriptionError
from pivident.robot.description import Robot


def without_loops(robot: Robot, what: str, instead: str = "") -> None:
    """Refuse a robot with closed loops where they are not handled yet.

    Args:
        robot: the robot.
        what: what does not handle them, as the subject of a sentence.
        instead: next step; empty: the methods that do handle them.

    Raises:
        RobotDescriptionError: the robot has closed loops.
    """
    without_base(robot, what, instead)
    if robot.constraints is None:
        return
    step = instead or "identify with ls, iv, piv or didim, which do, and look at their results"
    has = "closed loops"
    if not robot.constraints.closures:
        names = ", ".join(joint.name for joint in robot.passive_joints)
        has, step = (
            f"joints that follow others ({names})",
            f"let those that they follow stand still, and they do (frozen), or {step}",
        )
    raise RobotDescriptionError(
        f"robot {robot.name!r} has {has}, which {what} does not handle yet", advice=step
    )


def without_base(robot: Robot, what: str, instead: str = "") -> None:
    """Refuse a robot on a measured base where it is not handled yet.

    Args:
        robot: the robot.
        what: what does not handle it, as the subject of a sentence.
        instead: next step; empty: the methods that do handle it.

    Raises:
        RobotDescriptionError: the base of the robot is held by a sensor, or floats.
    """
    if robot.base_joints:
        step = instead or "identify with ls, iv or piv, which do, and look at their results"
        raise RobotDescriptionError(
            f"robot {robot.name!r} has a measured base, which {what} does not handle yet",
            advice=step,
        )


def without_wrenches(robot: Robot, what: str) -> None:
    """Refuse a robot whose recordings hold wrenches where they are not handled yet.

    Args:
        robot: the robot.
        what: what does not handle them, as the subject of a sentence.

    Raises:
        RobotDescriptionError: the robot has force sensors, or a measured base.
    """
    if robot.sensors or robot.base_joints:
        names = ", ".join(repr(sensor.name) for sensor in robot.sensors) or "its base"
        raise RobotDescriptionError(
            f"robot {robot.name!r} has measured wrenches ({names}), which {what} does not handle "
            "yet",
            advice="identify with ls, iv or piv, which do",
        )
