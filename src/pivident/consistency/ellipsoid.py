"""The homogeneous ellipsoid with a body's mass, centre and moments.

With principal moments A, B, C of a body of mass m, the half axes are √(5 (A + B + C - 2 X)/2m),
X = A, B, C. If one of the moments exceeds the sum of the others there is none.
"""

from __future__ import annotations

import numpy as np

from pivident.consistency.pseudo_inertia import LinkBody
from pivident.robot.frames import Pose

#: Points of an outline.
POINTS = 73


def principal_axes(body: LinkBody) -> np.ndarray:
    """Directions of the principal axes in the link's frame, as columns, shape (3, 3)."""
    return np.linalg.eigh(body.inertia)[1]


def half_axes(body: LinkBody) -> np.ndarray:
    """Half axes of the ellipsoid [m], in the order of the principal moments, shape (3,)."""
    moments = body.principal_moments
    second = moments.sum() / 2.0 - moments
    if body.mass <= 0.0 or (second < 0.0).any():
        return np.full(3, np.nan)
    return np.sqrt(5.0 * second / body.mass)


def outline(body: LinkBody, frame: Pose, plane: tuple[int, int]) -> np.ndarray:
    """Closed outline of the ellipsoid in the base frame, along a coordinate axis, (points, 2) [m].

    The shadow of the ellipsoid xᵀ M⁻¹ x ≤ 1 on a plane is the ellipse of the rows and columns of
    M that belong to the plane. NaN where no ellipsoid has these moments.
    """
    axes = (frame.rotation @ principal_axes(body) * half_axes(body))[list(plane)]
    if not np.isfinite(axes).all():
        return np.full((POINTS, 2), np.nan)
    values, directions = np.linalg.eigh(axes @ axes.T)
    angle = np.linspace(0.0, 2.0 * np.pi, POINTS)
    circle = np.stack([np.cos(angle), np.sin(angle)])
    center = frame.rotation @ body.center_of_mass + frame.translation
    return (directions * np.sqrt(np.maximum(values, 0.0)) @ circle).T + center[list(plane)]


def moment_about_axis(point: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """Coefficients (10,) of the moment of inertia about the axis through p along unit vector v.

    vᵀ J v - 2 ((p·h) - (v·p)(v·h)) + m (|p|² - (v·p)²)
    """
    v, p = np.asarray(direction, dtype=float), np.asarray(point, dtype=float)
    x, y, z = v
    first = -2.0 * (p - (v @ p) * v)
    second = [x * x, 2 * x * y, 2 * x * z, y * y, 2 * y * z, z * z]
    return np.array([*second, *first, p @ p - (v @ p) ** 2])
