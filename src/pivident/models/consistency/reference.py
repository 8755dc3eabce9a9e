"""The reference: prior values of the links, from their inertia or geometry, and parameter scales.

The nominal inertias of a robot, made consistent if necessary. A link without nominal inertia is
assumed to be a uniform body, see `geometric_bodies`.

Uniform bodies from a robot's geometry alone, for links without nominal inertia.

A solid cylinder from the link's frame to its farthest child's, or to where it closes a loop, half a
thickness longer at either end where the joints are. Arms taper: the thickness is a share of the
reach, from the base to the last link. The density is that of the links that are described; without
any, that with which the bodies carry the first moments of the estimate; without these, a usual
one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pivident.dynamics.base_parameters import BaseParameters
from pivident.dynamics.forward import mass_matrix
from pivident.dynamics.parameters import Parameter, nominal_values
from pivident.foundation.errors import ExperimentError
from pivident.foundation.text.numbers import format_significant
from pivident.models.consistency.pseudo_inertia import STEEL, inertial_parameters, pseudo_inertia
from pivident.robot.description import INERTIAL, Robot

#: Smallest second moment of a reference link about its centre of mass over its largest one.
FLATTEST = 1e-4
#: Mass [kg] and second moment [kg m²] below which a reference link counts as massless.
MIN_MASS, MIN_MOMENT = 1e-6, 1e-12
#: Number of random postures for the inertia that a joint carries.
POSTURES = 32
#: Density of a link without nominal inertia: aluminium, half hollow [kg/m³], and its limits, a
#: light cover and solid steel.
DENSITY, MIN_DENSITY, MAX_DENSITY = 1300.0, 300.0, 7850.0
#: Thickness of the first and of the last link over the reach, and the shortest reach [m].
THICKEST, THINNEST, SHORTEST = 1 / 10, 1 / 20, 0.2


@dataclass(frozen=True, eq=False)
class Reference:
    """A consistent set of standard parameters, and the scale of each."""

    values: np.ndarray  # standard parameters, shape (standard,)
    scales: np.ndarray  # size of a large change of each, shape (standard,)
    roots: np.ndarray  # P₀^-½ of each body, shape (bodies, 4, 4): from a link to its scale
    # of the steel ball that bounds each link from below [m], shape (bodies,): smaller for a light
    # or thin link
    diameters: np.ndarray
    assumed: np.ndarray  # which links have no nominal inertia, shape (bodies,)
    notes: tuple[str, ...]  # where it comes from, sentences

    def scaled(self, link: int, matrix: np.ndarray) -> np.ndarray:
        """P₀^-½ P P₀^-½ of a body, for one matrix or many, shape (..., 4, 4)."""
        return self.roots[link] @ matrix @ self.roots[link]


def body_links(robot: Robot) -> tuple[int, ...]:
    """Indices in the tree of the links that are bodies."""
    return tuple(i for i, link in enumerate(robot.tree.links) if link.is_body)


def link_places(robot: Robot, standard: Sequence[Parameter]) -> np.ndarray:
    """Indices of the ten inertial parameters of each link that is a body, shape (bodies, 10)."""
    row = {i: k for k, i in enumerate(body_links(robot))}
    places = np.empty((len(row), len(INERTIAL)), dtype=np.int64)
    for k, p in enumerate(standard):
        if p.is_inertial:
            places[row[p.joint], INERTIAL.index(p.stem)] = k
    return places


def geometric_bodies(robot: Robot) -> np.ndarray:
    """Pseudo-inertia of every link as a body of density one, shape (tree joints, 4, 4)."""
    at = _along(robot.tree)
    reach = max(float(at.max(initial=0.0)), SHORTEST)
    bodies = np.empty((len(at), 4, 4))
    for i, ends in enumerate(_ends(robot)):
        end = max(ends, key=lambda e: float(np.linalg.norm(e)), default=np.zeros(3))
        share = THICKEST + (THINNEST - THICKEST) * float(at[i]) / reach
        bodies[i] = _cylinder(np.asarray(end, dtype=float), share * reach)
    return bodies


def link_spheres(robot: Robot) -> list[tuple[np.ndarray, float]]:
    """Middle of each tree link, shape (3,), and how far it reaches from there by its joints [m].

    A link reaches the greatest thickness of the arm beyond its joints, and twice that where none
    follows: what hangs there is mounted, a hand or a tool.
    """
    reach = max(float(_along(robot.tree).max(initial=0.0)), SHORTEST)
    spheres = []
    for ends in _ends(robot):
        corners = np.array([np.zeros(3), *ends])
        low, high = corners.min(axis=0), corners.max(axis=0)
        beyond = THICKEST * reach * (1.0 if ends else 2.0)
        spheres.append(((low + high) / 2.0, float(np.linalg.norm(high - low)) / 2.0 + beyond))
    return spheres


def _ends(robot: Robot) -> list[list[np.ndarray]]:
    """Where further joints and closures are on each link of the tree [m]."""
    ends: list[list[np.ndarray]] = [[] for _ in range(robot.tree.size)]
    for joint in robot.tree.joints:
        if joint.parent >= 0:
            ends[joint.parent].append(np.asarray(joint.translation, dtype=float))
    for closure in robot.constraints.closures if robot.constraints else ():
        for link, frame in zip(closure.links, closure.frames, strict=True):
            if link >= 0:
                ends[link].append(frame.translation)
    return ends


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


def make_reference(
    robot: Robot,
    standard: Sequence[Parameter],
    diameter: float,
    given: Robot | np.ndarray | None = None,
    density: float = DENSITY,
) -> Reference:
    """Nominal values made consistent; links without any are assumed to be solid cylinders.

    The cylinders have the density of the other links, or ``density`` [kg/m³] if there are none.
    Every link is at least as large as a steel ball of ``diameter`` [m]. Another description with
    the same joints, or standard parameters, may be ``given`` in place of the nominal ones.
    """
    values = _given_values(robot, standard, given)
    closed, robot = robot, robot.tree
    notes: list[str] = []
    repaired = []
    links = [robot.links[i] for i in body_links(robot)]
    places = link_places(robot, standard)
    assumed = ~(values[places[:, 9]] > 0.0)  # an inertia without a mass is no body's
    if assumed.any():
        bodies = geometric_bodies(closed)[list(body_links(robot))]
        masses = values[places[:, 9]]
        if (known := masses > 0.0).any():
            density = density_of_bodies(bodies[known], masses[known])
    roots, diameters = np.empty((len(links), 4, 4)), np.empty(len(links))
    scales = np.ones(len(standard))
    for i, (link, place) in enumerate(zip(links, places, strict=True)):
        matrix = density * bodies[i] if assumed[i] else pseudo_inertia(values[place])
        real = _real_body(matrix)
        if not (assumed[i] or np.allclose(real, matrix, rtol=1e-9, atol=0.0)):
            repaired.append(link.name)
        values[place] = inertial_parameters(real)
        scales[place] = _inertial_scales(real)
        roots[i] = _inverse_root(real)
        diameters[i] = _ball_within(real, diameter)
    if assumed.any():
        named = ", ".join(link.name for link, own in zip(links, assumed, strict=True) if own)
        notes.append(
            f"No nominal inertia of {named}: undetermined parameters are close to those of solid "
            f"cylinders along the link, {format_significant(density)} kg/m³; give CAD values "
            "(reference)"
        )
    if repaired:
        notes.append(
            f"The reference inertias of {', '.join(repaired)} are physically impossible (or flat); "
            "the nearest possible ones are used instead"
        )
    carried = _carried_inertia(robot, standard, values)
    unknown = []
    for k, p in enumerate(standard):
        if p.is_inertial:
            continue
        values[k] = max(values[k], 0.0) if p.is_dissipative else values[k]
        # a rotor without a description may be as heavy as everything its joint moves: it, and not a
        # link with known inertia, absorbs the inertia in excess of the links
        size = carried[p.joint] if p.stem in ("ia", "iam") else 1.0
        scales[k] = abs(values[k]) or size or 1.0  # a joint may carry nothing
        if p.stem == "ia" and values[k] == 0.0:
            unknown.append(robot.joints[p.joint].name)
    if unknown:
        notes.append(
            f"No rotor inertia of {', '.join(unknown)} is known (a URDF has none): torques hardly "
            "distinguish the rotors of the first joints from the links; give rotor_inertia under "
            "[robot]"
        )
    return Reference(values, scales, roots, diameters, assumed, tuple(notes))


def _given_values(
    robot: Robot, standard: Sequence[Parameter], given: Robot | np.ndarray | None
) -> np.ndarray:
    """Standard parameters of a reference."""
    if given is None:
        return nominal_values(robot, tuple(standard))
    if isinstance(given, Robot):
        ours, theirs = robot.tree.joint_names, given.tree.joint_names
        if ours != theirs:
            raise ExperimentError(
                f"the reference has the joints {', '.join(theirs)}, the robot {', '.join(ours)}",
                advice="give a description of the same arm",
            )
        values = nominal_values(given, tuple(standard))
        # a URDF has no rotors: if the reference has none, the robot's own are kept
        own = nominal_values(robot, tuple(standard))
        missing = np.array([not p.is_inertial for p in standard]) & (values == 0.0)
        return np.where(missing, own, values)
    values = np.array(given, dtype=float)
    if values.shape != (len(standard),) or not np.isfinite(values).all():
        raise ExperimentError(
            f"the reference has shape {values.shape} or is not finite",
            advice=f"robot {robot.name!r} has {len(standard)} standard parameters",
        )
    return values


def _real_body(matrix: np.ndarray) -> np.ndarray:
    """The matrix itself if it belongs to a body that is not flat; else with moments raised.

    A mass without inertia becomes a ball of that mass.
    """
    mass, center, values, axes = _central(matrix)
    least = FLATTEST * values[-1]
    if values[-1] < MIN_MOMENT:
        diameter = (6.0 * mass / (np.pi * DENSITY)) ** (1.0 / 3.0)
        least = mass * diameter**2 / 20.0
    if mass == matrix[3, 3] and values[0] >= least:
        return matrix
    real = np.zeros((4, 4))
    real[:3, :3] = (axes * np.maximum(values, least)) @ axes.T + mass * np.outer(center, center)
    real[:3, 3] = real[3, :3] = mass * center
    real[3, 3] = mass
    return real


def _ball_within(real: np.ndarray, diameter: float) -> float:
    """Diameter of a steel ball with at most a tenth of a body's mass and second moments [m]."""
    mass, _, values, _ = _central(real)
    density = STEEL * np.pi / 6.0
    return min(
        diameter,
        float((0.1 * mass / density) ** (1.0 / 3.0)),
        float((0.1 * values[0] * 20.0 / density) ** (1.0 / 5.0)),
    )


def _central(matrix: np.ndarray) -> tuple[float, np.ndarray, np.ndarray, np.ndarray]:
    """Mass, centre of mass, second moments about it (ascending) and their axes."""
    mass = max(matrix[3, 3], MIN_MASS)
    center = matrix[:3, 3] / mass
    central = matrix[:3, :3] - mass * np.outer(center, center)
    values, axes = np.linalg.eigh(0.5 * (central + central.T))
    return mass, center, values, axes


def _inverse_root(matrix: np.ndarray) -> np.ndarray:
    """P^-½, symmetric."""
    values, vectors = np.linalg.eigh(matrix)
    return (vectors / np.sqrt(values)) @ vectors.T


def _carried_inertia(robot: Robot, standard: Sequence[Parameter], values: np.ndarray) -> np.ndarray:
    """Largest inertia of the links that each joint moves, over some postures, shape (joints,)."""
    links = tuple(p for p in standard if p.is_inertial)
    inertia = np.array([v for p, v in zip(standard, values, strict=True) if p.is_inertial])
    q = np.random.default_rng(0).uniform(-np.pi, np.pi, (POSTURES, robot.size))
    for j in np.flatnonzero([joint.kind == "prismatic" for joint in robot.joints]):
        low, high = robot.joints[j].position_limits or (0.0, 0.0)
        q[:, j] = low + (high - low) * (0.5 + q[:, j] / (2.0 * np.pi))
    return np.einsum("kjj->kj", mass_matrix(robot, links, inertia, q)).max(axis=0)


def _inertial_scales(matrix: np.ndarray) -> np.ndarray:
    """Scale of the ten parameters of a body: second moment, first moment, mass."""
    second, mass = float(np.trace(matrix[:3, :3])), float(matrix[3, 3])
    return np.r_[np.full(6, second), np.full(3, np.sqrt(second * mass)), mass]
