"""Ten inertial parameters of a body: built from data at its centre of mass, moved between frames.

The order is that of `pivident.robot.description.INERTIAL`: the inertia tensor at the frame's
origin (xx xy xz yy yz zz, elements of the tensor, so xy = -∫ x y dm), the first moments (mx my mz)
and the mass. All maps here are linear in the ten parameters, so that bodies add up.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


def tensor(elements: np.ndarray) -> np.ndarray:
    """Symmetric matrix, shape (3, 3), of xx xy xz yy yz zz."""
    xx, xy, xz, yy, yz, zz = elements
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def elements(inertia_tensor: np.ndarray) -> np.ndarray:
    """The six elements xx xy xz yy yz zz of a symmetric matrix, shape (6,)."""
    return inertia_tensor[np.triu_indices(3)]


def steiner(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """(aᵀb) 1 - (a bᵀ + b aᵀ)/2: with a = b it is the inertia of a unit mass at a."""
    return np.dot(a, b) * np.eye(3) - 0.5 * (np.outer(a, b) + np.outer(b, a))


def from_center_of_mass(
    mass: float, center_of_mass: np.ndarray, inertia_tensor: np.ndarray
) -> np.ndarray:
    """Ten parameters from mass m, c (3,) and J_c (3, 3) at c: J = J_c + m (cᵀc 1 - c cᵀ)."""
    at_origin = inertia_tensor + mass * steiner(center_of_mass, center_of_mass)
    return np.concatenate([elements(at_origin), mass * np.asarray(center_of_mass), [mass]])


def moved(inertia: np.ndarray, rotation: np.ndarray, translation: np.ndarray) -> np.ndarray:
    """The same body (10,) in another frame, R and p the pose of its old one there: parallel axes.

    With h the first moments and S `steiner`,

        m' = m,    h' = R h + m p,    J' = R J Rᵀ + 2 S(p, R h) + m S(p, p)
    """
    mass, first_moments = inertia[9], rotation @ inertia[6:9]
    at_origin = (
        rotation @ tensor(inertia[:6]) @ rotation.T
        + 2.0 * steiner(translation, first_moments)
        + mass * steiner(translation, translation)
    )
    return np.concatenate([elements(at_origin), first_moments + mass * translation, [mass]])


@dataclass(frozen=True, eq=False)
class Body:
    """A body in some frame, as CAD and file formats describe it."""

    mass: float  # [kg]
    center_of_mass: np.ndarray  # [m], shape (3,); NaN without mass
    inertia: np.ndarray  # about the centre of mass (without mass: the origin) [kg m²], shape (3, 3)

    @classmethod
    def of_parameters(cls, inertia: np.ndarray) -> Body:
        """The body of ten inertial parameters: c = h/m, J_c = J - m (cᵀc 1 - c cᵀ)."""
        mass, at_origin = float(inertia[9]), tensor(inertia[:6])
        if mass == 0.0:
            return cls(mass, np.full(3, np.nan), at_origin)
        center = np.asarray(inertia[6:9], dtype=float) / mass
        return cls(mass, center, at_origin - mass * steiner(center, center))

    @property
    def principal(self) -> tuple[np.ndarray, np.ndarray]:
        """Principal moments [kg m²], ascending, and the rotation with their axes as columns."""
        return principal_axes(self.inertia)


def principal_axes(inertia: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Principal moments, ascending, and the rotation whose columns are the principal axes."""
    moments, axes = np.linalg.eigh(inertia)
    axes[:, 0] *= np.sign(np.linalg.det(axes))
    return moments, axes
