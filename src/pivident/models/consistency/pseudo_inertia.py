"""Pseudo-inertia: the 4 × 4 matrix that is positive definite for every body, and its ellipsoid.

With Σ = ∫ r rᵀ dm, h = ∫ r dm and m the second moments, first moments and mass of a body,

    P = [[Σ, h], [hᵀ, m]] = ∫ (r, 1)(r, 1)ᵀ dm,      Σ = tr(J)/2 · 1 - J

(Wensing, Kim, Slotine 2018). P is linear in the ten inertial parameters. It is positive definite
if and only if the mass and the principal moments of inertia about the centre of mass are positive
and no principal moment exceeds the sum of the two others, as for any density that is not flat.

The homogeneous ellipsoid with a body's mass, centre and moments.

With principal moments A, B, C of a body of mass m, the half axes are √(5 (A + B + C - 2 X)/2m),
X = A, B, C. If one of the moments exceeds the sum of the others there is none.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np

from pivident.robot.frames import Pose
from pivident.robot.inertia import elements, steiner, tensor

#: Density of steel [kg/m³].
STEEL = 7850.0
#: Points of an outline.
POINTS = 73


def pseudo_inertia(inertia: np.ndarray) -> np.ndarray:
    """P of ten inertial parameters, shape (4, 4) [kg m², kg m, kg]."""
    at_origin = tensor(inertia[:6])
    matrix = np.empty((4, 4))
    matrix[:3, :3] = 0.5 * np.trace(at_origin) * np.eye(3) - at_origin
    matrix[:3, 3] = matrix[3, :3] = inertia[6:9]
    matrix[3, 3] = inertia[9]
    return matrix


def inertial_parameters(matrix: np.ndarray) -> np.ndarray:
    """The ten inertial parameters of a pseudo-inertia: J = tr(Σ) 1 - Σ."""
    second = matrix[:3, :3]
    return np.r_[elements(np.trace(second) * np.eye(3) - second), matrix[:3, 3], matrix[3, 3]]


def ball(diameter: float, density: float = STEEL) -> np.ndarray:
    """Pseudo-inertia of a solid ball about its centre: Σ = m d²/20 · 1."""
    mass = density * np.pi / 6.0 * diameter**3
    return np.diag([mass * diameter**2 / 20.0] * 3 + [mass])


def least_body(diameter: float, density: float = STEEL) -> tuple[np.ndarray, float]:
    """E (4, 4) [kg m²] and m_b [kg] of a body at least as large as a solid ball: P ≥ E, m ≥ m_b.

    With m_b the mass of the ball and e = m_b d²/20 its second moment, E = diag(e, e, e, 0). By the
    Schur complement of m in P - E, P ≥ E where Σ - h hᵀ/m ≥ e 1: the second moments about the
    body's own centre of mass, in any frame, are not below those of the ball.
    """
    matrix = ball(diameter, density)
    mass = float(matrix[3, 3])
    matrix[3, 3] = 0.0
    return matrix, mass


def triangle(matrix: np.ndarray) -> np.ndarray:
    """Upper triangle of symmetric matrices by columns, off-diagonals times √2.

    The scalar product of two such vectors is that of the matrices.
    """
    row, column, weight = _upper_triangle(matrix.shape[-1])
    return matrix[..., row, column] * weight


def from_triangle(vector: np.ndarray, order: int = 4) -> np.ndarray:
    """The symmetric matrices of :func:`triangle`, shape (..., order, order)."""
    row, column, weight = _upper_triangle(order)
    matrix = np.zeros((*vector.shape[:-1], order, order))
    matrix[..., row, column] = matrix[..., column, row] = vector / weight
    return matrix


@cache
def _upper_triangle(order: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Rows, columns and weights of the entries of :func:`triangle`."""
    column, row = np.tril_indices(order)
    return row, column, np.where(row == column, 1.0, np.sqrt(2.0))


#: P of each of the ten inertial parameters alone, shape (10, 4, 4).
BASIS = np.array([pseudo_inertia(unit) for unit in np.eye(10)])


@dataclass(frozen=True, eq=False)
class LinkBody:
    """A link's inertial parameters as in CAD programs."""

    name: str  # name of the link
    mass: float  # mass [kg]
    center_of_mass: np.ndarray  # in the link frame [m], shape (3,); NaN without mass
    inertia: np.ndarray  # about the centre of mass, axes of the link frame [kg m²], shape (3, 3)

    @property
    def principal_moments(self) -> np.ndarray:
        """Principal moments of inertia about the centre of mass [kg m²], ascending, shape (3,)."""
        return np.linalg.eigvalsh(self.inertia)


def link_body(name: str, inertia: np.ndarray) -> LinkBody:
    """The body of ten inertial parameters: c = h/m, J_c = J - m (cᵀc 1 - c cᵀ)."""
    mass = float(inertia[9])
    if mass == 0.0:
        return LinkBody(name, mass, np.full(3, np.nan), tensor(inertia[:6]))
    center = np.asarray(inertia[6:9], dtype=float) / mass
    return LinkBody(name, mass, center, tensor(inertia[:6]) - mass * steiner(center, center))


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
