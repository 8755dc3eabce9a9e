"""From the checked tables of a file to bodies, obstacles and clearances."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from pivident.foundation.errors import ExperimentError, RobotDescriptionError, concerning
from pivident.foundation.text.sentences import listed
from pivident.robot.description import Robot
from pivident.robot.frames import rotation_from_rpy
from pivident.robot.naming import nearest
from pivident.robot.refusals import without_loops
from pivident.studies.collision.apart import built_apart
from pivident.studies.collision.bodies import BASE, BY_HAND, Body
from pivident.studies.collision.clearances import Clearances
from pivident.studies.collision.obstacles import Obstacle, ToolBox
from pivident.studies.collision.outlines import outline_of

if TYPE_CHECKING:
    from pivident.experiment.excite_keys import BodyEntry, ObstacleEntry, RoomEntry


def clearances_of_room(robot: Robot, room: RoomEntry) -> Clearances:
    """What must stay apart, by the tables of a file.

    Args:
        robot: the robot, with the ranges that its joints move in: what can touch depends on them.
        room: the checked tables.

    Returns:
        The clearances; their remarks say where the bodies come from.

    Raises:
        ExperimentError: the tables contradict each other or the robot.
        RobotDescriptionError: a body names no link, or a mesh of the URDF cannot be found.
        MissingExtra: the URDF has meshes, and coal is not installed.
    """
    without_loops(robot, "the search for collisions")
    outline = outline_of(robot, bodies_of_entries(robot, room.body))
    things = [f"obstacle {entry.name!r}" for entry in room.obstacle]
    things += [] if room.floor is None else ["the floor"]
    if things and all(body.link < 0 for body in outline.bodies):
        raise ExperimentError(
            f"no body of {robot.name!r} is known, so that nothing keeps it from {listed(things)}",
            advice=f"give its bodies by hand: {BY_HAND}",
        ).about("body")
    apart, remarks = built_apart(robot, outline, room.clearance)
    found = Clearances.of(
        robot,
        outline.bodies,
        obstacles_of_entries(room.obstacle),
        floor=room.floor,
        tool_box=tool_box_of_entry(room),
        clearance=room.clearance,
        apart=apart,
    )
    return replace(found, remarks=(*outline.remarks, *remarks, *found.remarks))


def bodies_of_entries(robot: Robot, entries: Sequence[BodyEntry]) -> tuple[Body, ...]:
    """Bodies that a file gives by hand.

    Args:
        robot: the robot, whose links they name; ``base`` is the fixed one.
        entries: the checked entries of the table ``body``.

    Returns:
        The bodies, in order.

    Raises:
        RobotDescriptionError: there is no such link; names the nearest ones.
    """
    bodies = []
    for number, entry in enumerate(entries):
        with concerning("body", str(number)):
            link = -1 if entry.link == BASE else _link_index(robot, entry)
            bodies.append(
                Body(
                    entry.name,
                    link,
                    np.array(entry.start, dtype=float),
                    np.array(entry.end, dtype=float),
                    float(entry.radius),
                )
            )
    return tuple(bodies)


def _link_index(robot: Robot, entry: BodyEntry) -> int:
    try:
        return robot.link_index(entry.link)
    except RobotDescriptionError:
        names = dict.fromkeys([BASE, *(link.name for link in robot.links), *robot.joint_names])
        raise RobotDescriptionError(
            f"body {entry.name!r}: robot {robot.name!r} has no link {entry.link!r}",
            advice=nearest(entry.link, names),
        ) from None


def obstacles_of_entries(entries: Sequence[ObstacleEntry]) -> tuple[Obstacle, ...]:
    """Obstacles that a file gives.

    Args:
        entries: the checked entries of the table ``obstacle``.

    Returns:
        The obstacles, in order.

    Raises:
        ExperimentError: one has no size.
    """
    obstacles = []
    for number, entry in enumerate(entries):
        with concerning("obstacle", str(number)):
            obstacles.append(_obstacle(entry))
    return tuple(obstacles)


def _obstacle(entry: ObstacleEntry) -> Obstacle:
    radius = entry.radius or 0.0
    if entry.start is not None and entry.end is not None:
        return Obstacle.capsule(entry.name, np.array(entry.start), np.array(entry.end), radius)
    return Obstacle(
        entry.name,
        entry.shape,
        rotation_from_rpy(*np.radians(entry.rpy_degrees)),
        np.array(entry.at, dtype=float),
        None if entry.size is None else np.array(entry.size, dtype=float),
        radius,
        entry.length or 0.0,
    )


def tool_box_of_entry(entry: RoomEntry) -> ToolBox | None:
    """The tool's box that a file gives, or None.

    Args:
        entry: the checked table.

    Returns:
        The box.

    Raises:
        ExperimentError: it is empty.
    """
    if entry.tool is None or entry.tool_box is None:
        return None
    return ToolBox(
        np.array(entry.tool, dtype=float),
        np.array(entry.tool_box.low, dtype=float),
        np.array(entry.tool_box.high, dtype=float),
    )
