"""Capsules around the ``<collision>`` elements of a robot's URDF."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path

from pivident.collision.bodies import BY_HAND, Body, Outline, numbered
from pivident.collision.capsules import Balls, Capsule, divided, enclosing_capsule
from pivident.collision.meshes import MeshFiles, load_mesh, mesh_triangles, mesh_vertices
from pivident.errors import RobotDescriptionError
from pivident.robot.description import Robot
from pivident.robot.frames import Pose
from pivident.robot.naming import errors_name
from pivident.robot.urdf import link_places, text_digest
from pivident.robot.urdf_xml import UrdfCollision, file_content, parse_collisions

#: Most capsules of one link; further shapes are merged, those first that lose least room.
MAX_CAPSULES = 3

#: Most shapes of one link that are treated one by one; more are one shape.
MAX_SHAPES = 40


@dataclass(frozen=True, eq=False)
class LinkShape:
    """A ``<collision>`` element in the frame of the moving link that carries it.

    Attributes:
        owner: name of the URDF link.
        link: index of the moving link, -1 for the base.
        pose: of the shape's frame in the moving link's frame.
        collision: the element.
        mesh: its file, None for the other shapes.
    """

    owner: str
    link: int
    pose: Pose
    collision: UrdfCollision
    mesh: Path | None

    def parts(self) -> list[Balls]:
        """What spans it, in the moving link's frame; a mesh may have two parts."""
        own = self.collision
        if own.shape == "mesh":
            assert self.mesh is not None
            mesh = load_mesh(self.mesh, own.size)
            parts = divided(mesh_vertices(mesh), mesh_triangles(mesh))
        elif own.shape == "box":
            parts = [Balls.box(own.size)]
        elif own.shape == "cylinder":
            parts = [Balls.cylinder(own.radius, own.length)]
        else:
            parts = [Balls.capsule(own.radius, own.length)]
        return [part.moved(self.pose.rotation, self.pose.translation) for part in parts]


def link_shapes(robot: Robot, without: Collection[int] = ()) -> list[LinkShape]:
    """All ``<collision>`` elements of a robot's URDF, in the frames of its moving links.

    Args:
        robot: the robot.
        without: links whose shapes are not wanted; their meshes may be missing.

    Returns:
        The shapes in the order of the file; none for a robot without a URDF.

    Raises:
        RobotDescriptionError: the file cannot be read, has changed since the robot was read, or
            names a mesh that cannot be found.
    """
    if robot.urdf is None or not robot.urdf.path:
        return []
    path = Path(robot.urdf.path)
    with errors_name(robot.urdf.path):
        content = file_content(path)
        if text_digest(content) != robot.urdf.sha256:
            raise RobotDescriptionError(
                "has changed since the robot was read", advice="read it again"
            )
        places = link_places(content, robot)
        files = MeshFiles(robot.urdf.path)
        shapes = []
        for owner, collisions in parse_collisions(content).items():
            link, pose = places[owner]
            for own in collisions if link not in without else ():
                try:
                    mesh = files.found(own.mesh) if own.shape == "mesh" else None
                except RobotDescriptionError as error:
                    raise RobotDescriptionError(
                        f"link {owner!r}: {error}, or give the link a capsule by hand: {BY_HAND}"
                    ) from error
                shapes.append(LinkShape(owner, link, pose @ own.origin, own, mesh))
    return shapes


def urdf_outline(robot: Robot, without: Collection[int] = ()) -> Outline | None:
    """Capsules around the collision shapes of a robot's URDF.

    Args:
        robot: the robot.
        without: links that are given by hand.

    Returns:
        The bodies; None where the robot has no URDF or no shape in it.

    Raises:
        RobotDescriptionError: a shape cannot be used or a mesh not be found.
        MissingExtra: there are meshes, and coal is not installed.
    """
    shapes = link_shapes(robot, without)
    if not shapes:
        return None
    bodies: list[Body] = []
    for link in range(-1, robot.size):
        own = [shape for shape in shapes if shape.link == link]
        if own:
            capsules = link_capsules([part for shape in own for part in shape.parts()])
            name = own[0].owner if link < 0 else robot.links[link].name
            bodies += (
                Body(each, link, capsule.start, capsule.end, capsule.radius)
                for each, capsule in zip(numbered(name, len(capsules)), capsules, strict=True)
            )
    return Outline(tuple(bodies), "urdf")


def link_capsules(shapes: list[Balls]) -> list[Capsule]:
    """Capsules around the shapes of one link, merged where little room is lost.

    Two are merged where the capsule around both is no larger than the two together, and the pair
    that loses the least where there are more than `MAX_CAPSULES`.

    Args:
        shapes: the shapes, in one frame.

    Returns:
        The capsules, at most `MAX_CAPSULES`; each shape is inside one of them.
    """
    if len(shapes) > MAX_SHAPES:
        shapes = [Balls.together(shapes)]
    parts = {k: (shape, _volume(shape)) for k, shape in enumerate(shapes)}
    merged: dict[tuple[int, int], tuple[Balls, float]] = {}
    while len(parts) > 1:
        for a, b in combinations(parts, 2):
            if (a, b) not in merged:
                both = Balls.together([parts[a][0], parts[b][0]])
                merged[a, b] = (both, _volume(both))
        loss = {
            (a, b): merged[a, b][1] - parts[a][1] - parts[b][1] for a, b in combinations(parts, 2)
        }
        a, b = min(loss, key=lambda pair: loss[pair])
        if loss[a, b] > 0.0 and len(parts) <= MAX_CAPSULES:
            break
        parts[max(parts) + 1] = merged[a, b]
        del parts[a], parts[b]
    return [enclosing_capsule(shape) for shape, _ in parts.values()]


def _volume(shape: Balls) -> float:
    return enclosing_capsule(shape, searched=False).volume
