"""Uniform bodies from a robot's geometry alone, for links without nominal inertia.

A solid cylinder from the link's frame to its farthest child's, or to where it closes a loop, half a
thickness longer at either end where the joints are. Arms taper: the thickness is a share of the
reach, from the base to the last link. The density is that of the links that are described; without
any, that with which the bodies carry the first moments of the estimate; without these, a usual
one.
"""

from __future__ import annotations

import numpy as np

from pivident.consistency.pseudo_inertia import inertial_parameters
from pivident.dynamics.base_parameters import BaseParameters
from pivident.robot.description import INERTIAL, Robot

#: Density of a link without nominal inertia: aluminium, half hollow [kg/m³], and its limits, a
#: light cover and solid steel.
DENSITY, MIN_DENSITY, MAX_DENSITY = 1300.0, 300.0, 7850.0

#: Thickness of the first and of the last link over the reach, and the shortest reach [m].
THICKEST, THINNEST, SHORTEST = 1 / 10, 1 / 20, 0.2


def geometric_bodies(robot: Robot) -> np.ndarray:
    """Pseudo-inertia of every link as a body of density one, shape (tree joints, 4, 4)."""
    closures = robot.constraints.closures if robot.constraints else ()
    robot = robot.tree
    at = _along(robot)
    reach = max(float(at.max(initial=0.0)), SHORTEST)
    bodies = np.empty((robot.size, 4, 4))
    for i in range(robot.size):
        ends = [j.translation for j in robot.joints if j.parent == i]
        for closure in closures:
            pairs = zip(closure.links, closure.frames, strict=True)
            ends += [frame.translation for link, frame in pairs if link == i]
        end = max(ends, key=lambda e: float(np.linalg.norm(e)), default=np.zeros(3))
        share = THICKEST + (THINNEST - THICKEST) * float(at[i]) / reach
        bodies[i] = _cylinder(np.asarray(end, dtype=float), share * reach)
    return bodies


def density_of_bodies(bodies: np.ndarray, masses: np.ndarray) -> float:
    """Density of described links: Σ m / Σ V, within limits [kg/m³]."""
    return float(np.clip(masses.sum() / bodies[:, 3, 3].sum(), MIN_DENSITY, MAX_DENSITY))


def density_of_estimate(base: BaseParameters, values: np.ndarray) -> float:
    """Density with which uniform bodies come nearest to estimated first moments [kg/m³].

    ρ = Σ b β / Σ b² over the first moments β among the base parameters, b those of the bodies of
    density one. Rotors do not enter, and torques of gravity determine them well.
    """
    own = np.zeros(len(base.standard))
    bodies = geometric_bodies(base.robot)
    for k, p in enumerate(base.standard):
        if p.is_inertial:
            own[k] = inertial_parameters(bodies[p.joint])[INERTIAL.index(p.stem)]
    moments = np.array([p.stem in ("mx", "my", "mz") for p in base.parameters])
    expected = base.values(own)[moments]
    squared = float(expected @ expected)
    if squared == 0.0:
        return DENSITY
    density = float(expected @ values[moments]) / squared
    return float(np.clip(density, MIN_DENSITY, MAX_DENSITY)) if density > 0.0 else DENSITY


def _along(robot: Robot) -> np.ndarray:
    """Length of the chain from the base to each link's frame, strokes included [m]."""
    at = np.zeros(robot.size)
    for i, joint in enumerate(robot.joints):
        stroke = joint.position_limits if joint.kind == "prismatic" else None
        own = float(np.linalg.norm(joint.translation)) + (stroke[1] - stroke[0] if stroke else 0.0)
        at[i] = own + (at[joint.parent] if joint.parent >= 0 else 0.0)
    return at


def _cylinder(end: np.ndarray, thickness: float) -> np.ndarray:
    """Pseudo-inertia of a solid cylinder of density one about the segment from zero to ``end``."""
    apart = float(np.linalg.norm(end))
    axis = end / apart if apart > 0.0 else np.array([0.0, 0.0, 1.0])
    radius, length = thickness / 2.0, apart + thickness
    mass, center, along = np.pi * radius**2 * length, end / 2.0, np.outer(axis, axis)
    central = radius**2 / 4.0 * (np.eye(3) - along) + length**2 / 12.0 * along
    matrix = np.zeros((4, 4))
    matrix[:3, :3] = mass * (central + np.outer(center, center))
    matrix[:3, 3] = matrix[3, :3] = mass * center
    matrix[3, 3] = mass
    return matrix
