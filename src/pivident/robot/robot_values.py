"""A robot as plain values for a JSON file, and back.

Everything that a `Robot` holds is stored, floats with all their digits, so the round trip is
exact. What does not belong together is refused here, what is wrong by itself by the codec and by
the classes of the robot.

This module needs pydantic_core and is imported only when a file is read or written.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np

from pivident.foundation.codec import decode
from pivident.foundation.errors import RobotDescriptionError, UnusableValue
from pivident.foundation.text.plain_values import LATER, As, Limits, Name, Sized, plain
from pivident.robot.closed_chains import check_closed
from pivident.robot.constraints import Closure, Constraints, LinearConstraint
from pivident.robot.description import (
    MAX_JOINTS,
    Coupling,
    Joint,
    Link,
    Robot,
    TorqueSide,
    UrdfFile,
)
from pivident.robot.frames import Vector3
from pivident.robot.joints import Contact
from pivident.robot.naming import errors_name
from pivident.robot.transmission import Transmission
from pivident.robot.wrench_sensor import WrenchSensor

FEW = Limits(max_length=MAX_JOINTS)


@dataclass(frozen=True, eq=False)
class Mechanism:
    """What closes the loops of a robot, with its passive joints and links."""

    joints: Annotated[tuple[Joint, ...], FEW]
    links: Annotated[tuple[Link, ...], FEW]
    places: Annotated[tuple[int, ...], FEW]
    closures: Annotated[tuple[Closure, ...], FEW]
    linear: Annotated[tuple[LinearConstraint, ...], FEW]
    posture: Annotated[np.ndarray, Sized(None), FEW]
    kept: Annotated[tuple[int, ...], Limits(max_length=6 * MAX_JOINTS)]
    driven: Annotated[tuple[int, ...], FEW, LATER] = ()


@dataclass(frozen=True, eq=False)
class RobotTable:
    """A robot as a file holds it."""

    name: Name
    description: str
    gravity: Vector3
    joints: Annotated[
        tuple[Joint, ...], Sized("joints"), Limits(min_length=1, max_length=MAX_JOINTS)
    ]
    links: Annotated[tuple[Link, ...], FEW]
    rotor_inertia: Annotated[np.ndarray, Sized("joints"), FEW]
    friction_nominal: Mapping[Name, float]
    couplings: tuple[Coupling, ...]
    transmission: Transmission
    urdf: UrdfFile | None
    torque_side: Annotated[TorqueSide, LATER] = "motor"
    constraints: Annotated[Mechanism | None, LATER] = None
    sensors: Annotated[tuple[WrenchSensor, ...], FEW, LATER] = ()
    contacts: Annotated[tuple[Contact, ...], FEW, LATER] = ()


#: Fields of a robot that its table has as they are.
SAME = tuple(key for key in RobotTable.__dataclass_fields__ if key != "constraints")


def robot_values(robot: Robot) -> dict[str, Any]:
    """The robot as dictionaries, lists, texts and finite numbers, ready for JSON."""
    with errors_name(f"robot {robot.name!r}"):
        return plain(_decoded(plain(table_of_robot(robot))))


def robot_of_values(content: Any) -> Robot:
    """The robot that `robot_values` has written."""
    return robot_of_table(_decoded(content))


def _decoded(content: Any) -> RobotTable:
    try:
        return decode(RobotTable, content)
    except UnusableValue as error:
        raise RobotDescriptionError.of_part("", error) from None


def table_of_robot(robot: Robot) -> RobotTable:
    """The robot as a file holds it."""
    own, closed = robot.constraints, None
    if own is not None:
        closed = Mechanism(robot.passive_joints, robot.passive_links, **vars(own))
    return RobotTable(**{key: getattr(robot, key) for key in SAME}, constraints=closed)


def robot_of_table(table: RobotTable) -> Robot:
    """The robot of a table; refuses parts that do not belong together."""
    own = {key: getattr(table, key) for key in SAME}
    closed, joints = table.constraints, len(table.joints)
    if closed is None:
        return Robot(**own)
    parts = dict(vars(closed))
    passive = {f"passive_{key}": parts.pop(key) for key in ("joints", "links")}
    constraints = _constraints(closed, Constraints(**parts), joints)
    robot = Robot(**own, **passive, constraints=constraints)
    check_closed(robot.tree, constraints)
    return robot


def _constraints(closed: Mechanism, made: Constraints, joints: int) -> Constraints:
    """The constraints; refuses counts that do not belong together."""
    count = joints + len(closed.joints)
    links = [link for closure in made.closures for link in closure.links]
    fit = {
        "links": len(closed.links) == len(closed.joints),
        "places": len(set(made.places)) == joints and set(made.places) <= set(range(count)),
        "closures": all(-1 <= link < count for link in links),
        "linear": all(one.ratios.size == count for one in made.linear),
        "posture": made.posture.size == count,
        "driven": set(made.driven) <= set(range(count)) - set(made.places),
        "kept": len(made.kept) == count - joints
        and sorted(set(made.kept) & set(range(len(made.names)))) == list(made.kept),
    }
    for key, fits in fit.items():
        if not fits:
            raise RobotDescriptionError(
                f"constraints.{key} does not fit {joints} joints and {count - joints} passive ones",
                advice="write the file again",
            )
    for frame in (frame for closure in made.closures for frame in closure.frames):
        if not np.abs(frame.rotation @ frame.rotation.T - np.eye(3)).max() <= 1e-9:
            raise RobotDescriptionError(
                "the rotation of a frame is not orthonormal", advice="write the file again"
            )
    return made


#: A robot in the files of results.
StoredRobot = Annotated[Robot, As(RobotTable, robot_values, robot_of_table)]
