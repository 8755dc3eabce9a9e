"""From the checked tables of a file to bodies, obstacles and clearances.

Bodies that are built close to each other: their capsules overlap, their own shapes never touch.

Links with two joints between them, as a base and an upper arm, are often near each other in every
posture. Where their capsules overlap, a motion would be kept out of postures that are free. Only
two positions count for such a pair, so a grid of them shows all that it can do.

Distances between the links of a URDF robot by their own shapes, for a motion that is found.

Each ``<collision>`` element counts as it is, triangle by triangle, as the library coal measures it.
Its capsules enclose it, so these distances are never smaller than those of `Clearances`, and the
difference is the room that the capsules give away.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np

from pivident.experiment.excite_keys import BodyEntry, ObstacleEntry, RoomEntry
from pivident.foundation.errors import ExperimentError, RobotDescriptionError, concerning
from pivident.foundation.extras import is_installed, require
from pivident.foundation.text.sentences import listed
from pivident.robot.description import Robot
from pivident.robot.frames import rotation_from_rpy
from pivident.robot.naming import nearest
from pivident.robot.refusals import without_loops
from pivident.studies.collision.bodies import (
    BASE,
    BY_HAND,
    Body,
    LinkPoses,
    Obstacle,
    Outline,
    ToolBox,
)
from pivident.studies.collision.clearances import Clearances
from pivident.studies.collision.meshes import load_mesh
from pivident.studies.collision.outlines import outline_of
from pivident.studies.collision.pairs import candidate_pairs, position_ranges
from pivident.studies.collision.urdf import LinkShape, link_shapes


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


#: Share of postures with capsules too near from which on the shapes themselves are measured.
OFTEN = 0.02
#: Positions of each of the two joints.
POSITIONS = 31
#: Least distance of two shapes that are taken to stay apart [m].
LEAST_GAP = 1e-3


def exact_distances(
    robot: Robot,
    links: Sequence[tuple[int, int]],
    q: np.ndarray,
    *,
    without: Collection[int] = (),
) -> np.ndarray:
    """Distances between the shapes of links.

    Args:
        robot: a robot that was read from a URDF.
        links: pairs of moving links by index, -1 for the base.
        q: joint positions [rad or m], shape (samples, joints).
        without: links whose shapes do not count; their meshes may be missing.

    Returns:
        Least distance of any two shapes of each pair of links [m], zero or less where they touch;
        NaN where a link has no shape; shape (pairs, samples).

    Raises:
        RobotDescriptionError: the robot has closed loops, or no URDF with shapes, or a mesh cannot
            be found.
        MissingExtra: coal is not installed.
    """
    without_loops(robot, "the search for collisions")
    coal = require("coal", extra="collision", purpose="the distance between meshes")
    shapes = link_shapes(robot, without)
    if not shapes:
        raise RobotDescriptionError(
            f"robot {robot.name!r} has no <collision> elements to measure",
            advice="read it from a URDF that has them",
        )
    shapes = [shape for shape in shapes if any(shape.link in pair for pair in links)]
    solids = [(shape, _solid(coal, shape)) for shape in shapes]
    poses = LinkPoses.of(robot, np.asarray(q, dtype=float))
    request = coal.DistanceRequest()
    found = np.full((len(links), len(q)), np.nan)
    for sample in range(len(q)):
        places = [_place(coal, poses, shape, sample) for shape in shapes]
        for row, (first, second) in enumerate(links):
            distances = [
                coal.distance(solid, places[i], other, places[k], request, coal.DistanceResult())
                for i, (shape, solid) in enumerate(solids)
                if shape.link == first
                for k, (against, other) in enumerate(solids)
                if against.link == second
            ]
            found[row, sample] = min(distances, default=np.nan)
    return found


def _solid(coal: Any, shape: LinkShape) -> Any:
    """The shape as coal measures it."""
    own = shape.collision
    if own.shape == "mesh":
        assert shape.mesh is not None
        return load_mesh(shape.mesh, own.size)
    if own.shape == "box":
        return coal.Box(*own.size)
    if own.shape == "sphere":
        return coal.Sphere(own.radius)
    return {"cylinder": coal.Cylinder, "capsule": coal.Capsule}[own.shape](own.radius, own.length)


def _place(coal: Any, poses: LinkPoses, shape: LinkShape, sample: int) -> Any:
    rotation = poses.rotation[shape.link, sample]
    origin = poses.origin[shape.link, sample]
    return coal.Transform3s(
        rotation @ shape.pose.rotation, origin + rotation @ shape.pose.translation
    )


def built_apart(
    robot: Robot, outline: Outline, clearance: float = 0.02
) -> tuple[frozenset[frozenset[str]], tuple[str, ...]]:
    """Pairs of bodies that need not be checked, because their shapes never touch.

    Args:
        robot: the robot, with the ranges that its joints move in.
        outline: its bodies; pairs of links with bodies by hand are always checked.
        clearance: distance that bodies keep [m].

    Returns:
        Names of the bodies of each pair, for `Clearances.of`, and remarks that say so. None where
        the robot has no URDF with shapes, or coal is not installed.

    Raises:
        RobotDescriptionError: a mesh of the URDF cannot be found.
    """
    if outline.source != "urdf" or not is_installed("coal"):
        return frozenset(), ()
    apart: set[frozenset[str]] = set()
    remarks = []
    for first, second in _two_joints_apart(robot):
        sides = [[body for body in outline.bodies if body.link == link] for link in (first, second)]
        if not all(sides) or {first, second} & set(outline.given):
            continue
        pairs = candidate_pairs(
            robot, [*sides[0], *sides[1]], (), clearance, floor=False, tool=False
        )
        q = _grid(robot, first, second)
        near = (Clearances(robot, tuple(pairs)).distances(q) < clearance).any(axis=0)
        if not near.mean() > OFTEN:
            continue
        (distance,) = exact_distances(robot, [(first, second)], q[near], without=outline.given)
        if distance.min() >= LEAST_GAP:
            apart |= {frozenset((a.name, b.name)) for a, b in product(*sides)}
            names = [robot.links[k].name if k >= 0 else BASE for k in (second, first)]
            remarks.append(
                f"Not checked: {' and '.join(names)}. Their capsules overlap "
                f"in some postures, their own shapes stay {1e3 * distance.min():.0f} mm apart or "
                f"more on a grid of {len(q)}."
            )
    return frozenset(apart), tuple(remarks)


def _grid(robot: Robot, first: int, second: int) -> np.ndarray:
    """Postures on a grid of the joints between two links, the others in their middles."""
    ancestors = [set(robot.ancestors(link)) if link >= 0 else set() for link in (first, second)]
    between = sorted(ancestors[0] ^ ancestors[1])
    low, high = position_ranges(robot)
    axes = [np.linspace(low[i], high[i], POSITIONS) for i in between]
    places = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, len(between))
    q = np.tile(0.5 * (low + high), (len(places), 1))
    q[:, between] = places
    return q


def _two_joints_apart(robot: Robot) -> list[tuple[int, int]]:
    """Links with two joints between them: a link and what carries its carrier, or two on one."""
    parents = [joint.parent for joint in robot.joints]
    return [
        (a, b)
        for b in range(robot.size)
        for a in range(-1, b)
        if a != parents[b]
        and (
            (parents[b] >= 0 and parents[parents[b]] == a) or (a >= 0 and parents[a] == parents[b])
        )
    ]
