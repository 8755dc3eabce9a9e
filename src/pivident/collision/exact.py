"""Distances between the links of a URDF robot by their own shapes, for a motion that is found.

Each ``<collision>`` element counts as it is, triangle by triangle, as the library coal measures it.
Its capsules enclose it, so these distances are never smaller than those of `Clearances`, and the
difference is the room that the capsules give away.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import Any

import numpy as np

from pivident.collision.meshes import load_mesh
from pivident.collision.poses import LinkPoses
from pivident.collision.urdf import LinkShape, link_shapes
from pivident.errors import RobotDescriptionError
from pivident.extras import require
from pivident.robot.description import Robot
from pivident.robot.refusals import without_loops


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
