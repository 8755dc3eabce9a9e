"""Pseudo-inertia: the 4 × 4 matrix that is positive definite for every possible body.

With Σ = ∫ r rᵀ dm, h = ∫ r dm and m the second moments, first moments and mass of a body,

    P = [[Σ, h], [hᵀ, m]] = ∫ (r, 1)(r, 1)ᵀ dm,      Σ = tr(J)/2 · 1 - J

(Wensing, Kim, Slotine 2018). P is linear in the ten inertial parameters. It is positive definite
if and only if the mass and the principal moments of inertia about the centre of mass are positive
and no principal moment exceeds the sum of the two others, as for any density that is not flat.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np

from pivident.robot.inertia import elements, steiner, tensor

#: Density of steel [kg/m³].
STEEL = 7850.0


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
