"""Bodies that are built close to each other: their capsules overlap, their own shapes never touch.

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
from itertools import product
from typing import Any

import numpy as np

from pivident.foundation.errors import RobotDescriptionError
from pivident.foundation.extras import is_installed, require
from pivident.robot.description import Robot
from pivident.robot.refusals import without_loops
from pivident.studies.collision.bodies import BASE, LinkPoses, Outline
from pivident.studies.collision.clearances import Clearances
from pivident.studies.collision.meshes import load_mesh
from pivident.studies.collision.pairs import candidate_pairs, position_ranges
from pivident.studies.collision.urdf import LinkShape, link_shapes

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
