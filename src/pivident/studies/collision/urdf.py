"""The smallest capsules around the ``<collision>`` elements of a robot's URDF.

The smallest capsule around a shape.

A shape is what balls span: the corners of a box or the vertices of a mesh (balls of radius zero),
a sphere (one ball), a capsule (two). A capsule is convex, so it encloses the shape once it encloses
its balls. For a given axis with axial positions z_i, distances r_i from it and radii b_i, a capsule
of radius ρ ≥ max(r_i + b_i) encloses all balls if its segment reaches from

    z_low = min_i (z_i + √((ρ - b_i)² - r_i²))    to    z_high = max_i (z_i - √((ρ - b_i)² - r_i²))

The axis and ρ of least volume are searched from the best of the principal axes. A search that stops
early costs room and nothing else: what it returns encloses the shape at every step.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path

import numpy as np
from scipy.optimize import minimize
from scipy.spatial import ConvexHull, QhullError

from pivident.foundation.errors import RobotDescriptionError
from pivident.robot.description import Robot
from pivident.robot.frames import Pose
from pivident.robot.naming import errors_name
from pivident.robot.urdf import link_places, text_digest
from pivident.robot.urdf_xml import UrdfCollision, file_content, parse_collisions
from pivident.studies.collision.bodies import BY_HAND, Body, Outline, numbered
from pivident.studies.collision.meshes import (
    MeshFiles,
    MissingMesh,
    load_mesh,
    mesh_triangles,
    mesh_vertices,
)

#: Most capsules of one link; further shapes are merged, those first that lose least room.
MAX_CAPSULES = 3
#: Most shapes of one link that are treated one by one; more are one shape.
MAX_SHAPES = 40
#: Corners of the polygon around the rims of a cylinder; it is 0.2 % wider than the circle.
RIM_CORNERS = 48
#: Excesses of ρ over the least possible radius, as shares of it, that the search may start from.
FIRST_EXCESSES = (0.0, 0.05, 0.2)
#: Places along each principal axis at which a mesh may be cut in two, and the share of the volume
#: of one capsule that two have to stay below.
CUTS, CUT_SHARE = 8, 0.8
#: Radius added to every capsule, against rounding [m].
ROUNDING = 1e-9


@dataclass(frozen=True, eq=False)
class Balls:
    """Balls that span a convex shape.

    Attributes:
        centres: [m], shape (balls, 3).
        radii: [m], shape (balls,).
    """

    centres: np.ndarray
    radii: np.ndarray

    @classmethod
    def points(cls, points: np.ndarray) -> Balls:
        """Points, of which only the corners of their convex hull are kept."""
        if len(points) > 8:
            try:
                points = points[ConvexHull(points).vertices]
            except QhullError:  # all in one plane: all are kept
                pass
        return cls(points, np.zeros(len(points)))

    @classmethod
    def box(cls, size: np.ndarray) -> Balls:
        """The corners of a box around the origin with edges ``size`` [m]."""
        signs = np.array(np.meshgrid(*[[-0.5, 0.5]] * 3)).reshape(3, -1).T
        return cls.points(signs * size)

    @classmethod
    def cylinder(cls, radius: float, length: float) -> Balls:
        """Polygons around the two rims of a cylinder along z around the origin [m]."""
        angle = 2.0 * np.pi * np.arange(RIM_CORNERS) / RIM_CORNERS
        wide = radius / np.cos(np.pi / RIM_CORNERS)
        rim = np.column_stack([wide * np.cos(angle), wide * np.sin(angle), np.zeros(RIM_CORNERS)])
        half = np.array([0.0, 0.0, 0.5 * length])
        return cls.points(np.vstack([rim - half, rim + half]))

    @classmethod
    def capsule(cls, radius: float, length: float) -> Balls:
        """Two balls along z around the origin; one where the length is zero [m]."""
        ends = np.array([[0.0, 0.0, -0.5 * length], [0.0, 0.0, 0.5 * length]])
        ends = ends if length > 0.0 else ends[:1]
        return cls(ends, np.full(len(ends), radius))

    @classmethod
    def together(cls, parts: Iterable[Balls]) -> Balls:
        """All balls of several shapes."""
        parts = list(parts)
        return cls(
            np.vstack([part.centres for part in parts]),
            np.concatenate([part.radii for part in parts]),
        )

    def moved(self, rotation: np.ndarray, translation: np.ndarray) -> Balls:
        """The same shape in another frame: x → rotation · x + translation."""
        return Balls(self.centres @ rotation.T + translation, self.radii)


@dataclass(frozen=True, eq=False)
class Capsule:
    """A capsule: ends of its segment [m], shapes (3,), and its radius [m]."""

    start: np.ndarray
    end: np.ndarray
    radius: float

    @property
    def volume(self) -> float:
        """π ρ² L + 4/3 π ρ³ [m³]."""
        return _volume_of_capsule(self.radius, float(np.linalg.norm(self.end - self.start)))


def enclosing_capsule(balls: Balls, *, searched: bool = True) -> Capsule:
    """A capsule of small volume around a shape.

    Args:
        balls: the balls that span it.
        searched: whether its axis is searched, or the best principal axis is good enough.

    Returns:
        The capsule; it encloses all balls.
    """
    if len(balls.radii) == 1 or (len(balls.radii) == 2 and np.ptp(balls.radii) == 0.0):
        return Capsule(balls.centres[0], balls.centres[-1], float(balls.radii[0]) + ROUNDING)
    centre, axes = _principal_axes(balls.centres)
    local = Balls((balls.centres - centre) @ axes, balls.radii)
    # each principal axis in turn as the z axis, through the middle of the shape's extent
    starts = []
    for k in range(3):
        turned = local.centres @ np.roll(np.eye(3), k, axis=1)
        extent = 0.5 * (turned.max(axis=0) + turned.min(axis=0))
        for excess in FIRST_EXCESSES:
            unknowns = np.array([extent[0], extent[1], 0.0, 0.0, excess])
            starts.append((_along(unknowns, turned, local.radii)[0], k, unknowns))
    _, k, unknowns = min(starts, key=lambda start: start[0])
    turn = np.roll(np.eye(3), k, axis=1)
    turned = local.centres @ turn
    if searched:
        unknowns = _least_volume(unknowns, turned, local.radii)
    _, start, end, radius = _along(unknowns, turned, local.radii)
    back = axes @ turn
    return Capsule(centre + back @ start, centre + back @ end, radius)


def _least_volume(unknowns: np.ndarray, centres: np.ndarray, radii: np.ndarray) -> np.ndarray:
    """Nelder and Mead's search for the axis, see `_along`: the volume has kinks."""
    size = float(np.ptp(centres, axis=0).max())
    steps = np.diag([0.05 * size, 0.05 * size, 0.1, 0.1, 0.05])
    simplex = np.vstack([unknowns, unknowns + steps])
    options = {"initial_simplex": simplex, "maxiter": 600, "xatol": 1e-5, "fatol": 1e-5}
    return minimize(
        lambda x: _along(x, centres, radii)[0], unknowns, method="Nelder-Mead", options=options
    ).x


def divided(vertices: np.ndarray, triangles: np.ndarray) -> list[Balls]:
    """A mesh as one shape, or cut in two where that saves much room: arms have corners.

    The triangles that the plane of the cut divides belong to both parts, each up to the plane.

    Args:
        vertices: [m], shape (vertices, 3).
        triangles: indices of their corners, shape (triangles, 3).

    Returns:
        One shape or two, which together span the surface.
    """
    whole = Balls.points(vertices)
    best, parts = CUT_SHARE * enclosing_capsule(whole, searched=False).volume, [whole]
    ends = np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    edges = np.unique(ends, axis=0)
    for axis in _principal_axes(whole.centres)[1].T:
        heights = vertices @ axis
        for cut in np.linspace(heights.min(), heights.max(), CUTS + 2)[1:-1]:
            above = heights - cut
            first, second = edges[above[edges].prod(axis=1) < 0.0].T
            share = above[first] / (above[first] - above[second])
            crossing = vertices[first] + share[:, None] * (vertices[second] - vertices[first])
            both = [
                Balls.points(np.vstack([vertices[side], crossing]))
                for side in (above <= 0.0, above >= 0.0)
            ]
            volume = sum(enclosing_capsule(part, searched=False).volume for part in both)
            if volume < best:
                best, parts = volume, both
    return parts


def _along(
    unknowns: np.ndarray, centres: np.ndarray, radii: np.ndarray
) -> tuple[float, np.ndarray, np.ndarray, float]:
    """Log volume, ends and radius of the capsule along an axis near z.

    The unknowns are the x and y at which the axis crosses the plane z = 0, its slopes dx/dz and
    dy/dz, and the excess of ρ over the least possible radius, as a share of it.
    """
    through = np.array([unknowns[0], unknowns[1], 0.0])
    axis = np.array([unknowns[2], unknowns[3], 1.0])
    axis /= np.sqrt(axis @ axis)
    relative = centres - through
    axial = relative @ axis
    squared = np.einsum("ij,ij->i", relative, relative) - axial**2
    radial = np.sqrt(np.maximum(squared, 0.0))
    radius = float((1.0 + abs(unknowns[4])) * (radial + radii).max()) + ROUNDING
    cap = np.sqrt(np.maximum((radius - radii) ** 2 - radial**2, 0.0))
    low, high = float((axial + cap).min()), float((axial - cap).max())
    if low > high:  # a ball is enough, anywhere between the two
        low = high = 0.5 * (low + high)
    volume = _volume_of_capsule(radius, high - low)
    return float(np.log(volume)), through + low * axis, through + high * axis, radius


def _principal_axes(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Centre of the points, and a right-handed frame along their principal axes as columns."""
    centre = points.mean(axis=0)
    _, _, axes = np.linalg.svd(points - centre, full_matrices=True)
    axes[2] *= np.sign(np.linalg.det(axes))
    return centre, axes.T


def _volume_of_capsule(radius: float, length: float) -> float:
    return float(np.pi * radius**2 * (length + 4.0 / 3.0 * radius))


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


def link_shapes(
    robot: Robot, without: Collection[int] = (), missing: dict[int, str] | None = None
) -> list[LinkShape]:
    """All ``<collision>`` elements of a robot's URDF, in the frames of its moving links.

    Args:
        robot: the robot.
        without: links whose shapes are not wanted; their meshes may be missing.
        missing: is given the links of which a mesh is missing, with one such mesh; without it a
            missing mesh is refused.

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
                except MissingMesh:
                    if missing is None:
                        raise
                    missing[link] = own.mesh
                    continue
                except RobotDescriptionError as error:
                    raise RobotDescriptionError.of_part(f"link {owner!r}: ", error).followed_by(
                        f", or give the link a capsule by hand: {BY_HAND}"
                    ) from error
                shapes.append(LinkShape(owner, link, pose @ own.origin, own, mesh))
    return shapes


def urdf_outline(robot: Robot, without: Collection[int] = ()) -> Outline | None:
    """Capsules around the collision shapes of a robot's URDF.

    Args:
        robot: the robot.
        without: links that are given by hand.

    Returns:
        The bodies but those of links of which a mesh is missing, which are named; None where the
        robot has no URDF or no shape in it.

    Raises:
        RobotDescriptionError: a shape or a mesh cannot be used.
        MissingExtra: there are meshes, and coal is not installed.
    """
    missing: dict[int, str] = {}
    shapes = link_shapes(robot, without, missing)
    shapes = [shape for shape in shapes if shape.link not in missing]
    if not shapes and not missing:
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
    return Outline(tuple(bodies), "urdf", missing=missing)


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
