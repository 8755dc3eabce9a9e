"""The smallest capsule around a shape.

A shape is what balls span: the corners of a box or the vertices of a mesh (balls of radius zero),
a sphere (one ball), a capsule (two). A capsule is convex, so it encloses the shape once it encloses
its balls. For a given axis with axial positions z_i, distances r_i from it and radii b_i, a capsule
of radius ρ ≥ max(r_i + b_i) encloses all balls if its segment reaches from

    z_low = min_i (z_i + √((ρ - b_i)² - r_i²))    to    z_high = max_i (z_i - √((ρ - b_i)² - r_i²))

The axis and ρ of least volume are searched from the best of the principal axes. A search that stops
early costs room and nothing else: what it returns encloses the shape at every step.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize
from scipy.spatial import ConvexHull, QhullError

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
        return _volume(self.radius, float(np.linalg.norm(self.end - self.start)))


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
    volume = _volume(radius, high - low)
    return float(np.log(volume)), through + low * axis, through + high * axis, radius


def _principal_axes(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Centre of the points, and a right-handed frame along their principal axes as columns."""
    centre = points.mean(axis=0)
    _, _, axes = np.linalg.svd(points - centre, full_matrices=True)
    axes[2] *= np.sign(np.linalg.det(axes))
    return centre, axes.T


def _volume(radius: float, length: float) -> float:
    return float(np.pi * radius**2 * (length + 4.0 / 3.0 * radius))
