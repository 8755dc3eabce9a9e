"""What a real machine's parameters must satisfy, as linear images of cones.

* every link: pseudo-inertia ≥ that of a small steel ball, see `reference`;
* drives: the matrix of rotor inertias, with coupled motors, is positive semidefinite, since
  ½ dqᵀ I dq is the rotors' kinetic energy; the same for viscous friction, whose power is
  dqᵀ F dq;
* other dissipative terms are not negative;
* bounds that the user declares.

A coupled motor adds ratio·iam between two joints (see `Coupling`): [[ia5, r iam6], [r iam6, ia6]]
on the TX40's wrist.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from pivident.consistency.cone_program import Cone
from pivident.consistency.pseudo_inertia import BASIS, triangle
from pivident.consistency.reference import Reference
from pivident.dynamics.parameters import Parameter
from pivident.errors import ExperimentError
from pivident.robot.description import INERTIAL, Robot
from pivident.robot.naming import nearest

#: Lowest and highest value; None: no bound on that side.
Interval = tuple[float | None, float | None]


@dataclass(frozen=True)
class Bounds:
    """What is known of the masses beyond that they are real; all by the name of the link.

    Attributes:
        mass: lowest and highest mass of a link [kg].
        total_mass: of all moving links together [kg].
        center_of_mass: box of a link's centre of mass in its frame: an interval for x, y, z [m].
        ellipsoid: ellipsoid that holds a link's centre of mass: its centre (x, y, z) and its half
            axes along the axes of the frame [m].
    """

    mass: Mapping[str, Interval] = field(default_factory=dict)
    total_mass: Interval | None = None
    center_of_mass: Mapping[str, tuple[Interval, Interval, Interval]] = field(default_factory=dict)
    ellipsoid: Mapping[str, tuple[Sequence[float], Sequence[float]]] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Constraint:
    """One condition on the standard parameters, F φ + g ∈ K.

    Attributes:
        subject: link or joint that it is about, or ``all links``.
        kind: what it demands, in words.
        cone: kind of K.
        order: order of the matrices of a semidefinite cone; otherwise the number of rows.
        matrix: F, shape (rows, standard).
        offset: g, shape (rows,).
    """

    subject: str
    kind: str
    cone: Cone
    order: int
    matrix: np.ndarray
    offset: np.ndarray


#: Words for the demand on a link, see `describe` in `nearest_consistent`.
REAL_BODY = "a real body"


def link_places(robot: Robot, standard: Sequence[Parameter]) -> np.ndarray:
    """Indices of each link's ten inertial parameters, shape (joints, 10)."""
    places = np.empty((robot.size, 10), dtype=np.int64)
    for k, p in enumerate(standard):
        if p.is_inertial:
            places[p.joint, INERTIAL.index(p.stem)] = k
    return places


def make_constraints(
    robot: Robot,
    standard: Sequence[Parameter],
    reference: Reference,
    bounds: Bounds | None = None,
) -> tuple[Constraint, ...]:
    """All conditions.

    Args:
        robot: the robot.
        standard: its standard parameters.
        reference: gives the scale of each link and the smallest body in it.
        bounds: declared ones.

    Raises:
        ExperimentError: bounds of unknown links, or empty ones.
    """
    made = _real_bodies(robot, standard, reference)
    made += _positive_forms(robot, standard, reference)
    made += _dissipative(robot, standard, reference)
    return tuple(made + _declared(robot, standard, reference, bounds or Bounds()))


def _real_bodies(
    robot: Robot, standard: Sequence[Parameter], reference: Reference
) -> list[Constraint]:
    """P̃ - P̃_small ≥ 0 of each link, on the scale of its reference."""
    made = []
    for i, place in enumerate(link_places(robot, standard)):
        matrix = np.zeros((10, len(standard)))
        matrix[:, place] = triangle(reference.scaled(i, BASIS)).T
        offset = -triangle(reference.scaled(i, reference.smallest[i]))
        made.append(Constraint(robot.links[i].name, REAL_BODY, "semidefinite", 4, matrix, offset))
    return made


def _positive_forms(
    robot: Robot, standard: Sequence[Parameter], reference: Reference
) -> list[Constraint]:
    """Positive semidefinite matrices of rotor inertia and of viscous friction of coupled joints."""
    made = []
    for own, coupled, kind in (
        ("ia", "iam", "rotor inertias of coupled motors that can exist together"),
        ("fv", "fvm", "viscous friction of coupled motors that feeds no energy in"),
    ):
        diagonal = {p.joint: k for k, p in enumerate(standard) if p.stem == own}
        for joints in coupled_joints(robot):
            if not all(j in diagonal for j in joints):
                continue  # another friction law: its terms are held non-negative one by one
            place = {joint: i for i, joint in enumerate(joints)}
            size = len(joints)
            form = np.zeros((len(standard), size, size))
            for joint in joints:
                form[diagonal[joint], place[joint], place[joint]] = 1.0
            found = False
            for k, p in enumerate(standard):
                if p.stem == coupled and p.coupling is not None and p.coupling.motor in place:
                    i, j = place[p.coupling.motor], place[p.coupling.joint]
                    form[k, i, j] = form[k, j, i] = p.coupling.ratio
                    found = True
            if not found:
                continue
            scale = 1.0 / np.sqrt([reference.scales[diagonal[j]] for j in joints])
            form = form * np.outer(scale, scale)
            rows = triangle(form)
            subject = " and ".join(robot.joints[j].name for j in joints)
            made.append(
                Constraint(subject, kind, "semidefinite", size, rows.T, np.zeros(rows.shape[1]))
            )
    return made


def coupled_joints(robot: Robot) -> list[tuple[int, ...]]:
    """Groups of joints whose motors are coupled, ascending."""
    groups: list[set[int]] = []
    for c in robot.couplings:
        touching = [g for g in groups if g & {c.motor, c.joint}]
        merged = {c.motor, c.joint}.union(*touching)
        groups = [g for g in groups if g not in touching] + [merged]
    return [tuple(sorted(g)) for g in groups]


def _dissipative(
    robot: Robot, standard: Sequence[Parameter], reference: Reference
) -> list[Constraint]:
    """Friction levels and rotor inertias that are not negative."""
    made = []
    for k, p in enumerate(standard):
        if not p.is_dissipative:
            continue
        matrix = np.zeros((1, len(standard)))
        matrix[0, k] = 1.0 / reference.scales[k]
        made.append(
            Constraint(
                robot.joints[p.joint].name,
                f"{p.name} not negative",
                "nonnegative",
                1,
                matrix,
                np.zeros(1),
            )
        )
    return made


def _declared(
    robot: Robot, standard: Sequence[Parameter], reference: Reference, bounds: Bounds
) -> list[Constraint]:
    """The user's bounds."""
    places = link_places(robot, standard)
    made = []
    for name, interval in bounds.mass.items():
        mass = places[_link(robot, name), 9:]
        made += _interval(name, "mass", interval, mass, len(standard), reference)
    if bounds.total_mass is not None:
        made += _interval(
            "all links", "total mass", bounds.total_mass, places[:, 9], len(standard), reference
        )
    for name, box in bounds.center_of_mass.items():
        place = places[_link(robot, name)]
        if len(box) != 3:
            raise ExperimentError(
                f"center_of_mass of link {name!r} needs three intervals, for x, y, z; it has "
                f"{len(box)}"
            )
        for axis, interval in enumerate(box):
            made += _box(name, axis, interval, place, len(standard), reference)
    for name, (center, axes) in bounds.ellipsoid.items():
        place = places[_link(robot, name)]
        c, a = np.asarray(center, float), np.asarray(axes, float)
        if c.shape != (3,) or a.shape != (3,) or not (np.isfinite(c).all() and (a > 0).all()):
            raise ExperimentError(
                f"ellipsoid of link {name!r} needs a centre of three numbers and three positive "
                f"half axes in m, not {center!r} and {axes!r}"
            )
        # |(h - c m)/a| ≤ m
        matrix = np.zeros((4, len(standard)))
        matrix[0, place[9]] = 1.0
        matrix[1:, place[6:9]] = np.diag(1.0 / a)
        matrix[1:, place[9]] = -c / a
        matrix /= reference.scales[place[9]]
        made.append(
            Constraint(
                name, "centre of mass in its ellipsoid", "second_order", 4, matrix, np.zeros(4)
            )
        )
    return made


def _interval(
    subject: str,
    what: str,
    interval: Interval,
    places: np.ndarray,
    size: int,
    reference: Reference,
) -> list[Constraint]:
    """Lowest ≤ Σ φ ≤ highest."""
    _check(subject, what, interval)
    scale = float(reference.scales[places].sum())
    made = []
    for bound, sign, words in zip(interval, (1.0, -1.0), ("at least", "at most"), strict=True):
        if bound is None:
            continue
        matrix = np.zeros((1, size))
        matrix[0, places] = sign / scale
        offset = np.array([-sign * bound / scale])
        made.append(
            Constraint(subject, f"{what} {words} {bound:g} kg", "nonnegative", 1, matrix, offset)
        )
    return made


def _box(
    name: str,
    axis: int,
    interval: Interval,
    place: np.ndarray,
    size: int,
    reference: Reference,
) -> list[Constraint]:
    """Lowest · m ≤ h ≤ highest · m."""
    label = "xyz"[axis]
    _check(name, f"center_of_mass {label}", interval)
    scale = reference.scales[place[6]]
    made = []
    for bound, sign, words in zip(interval, (1.0, -1.0), ("at least", "at most"), strict=True):
        if bound is None:
            continue
        matrix = np.zeros((1, size))
        matrix[0, place[6 + axis]] = sign / scale
        matrix[0, place[9]] = -sign * bound / scale
        kind = f"centre of mass {label} {words} {bound:g} m"
        made.append(Constraint(name, kind, "nonnegative", 1, matrix, np.zeros(1)))
    return made


def _check(subject: str, what: str, interval: Interval) -> None:
    """Refuse bounds that are no interval."""
    try:
        low, high = interval
        numbers = [float(b) for b in (low, high) if b is not None]
        good = bool(np.isfinite(numbers).all()) and (len(numbers) < 2 or numbers[0] < numbers[1])
    except (TypeError, ValueError):
        good = False
    if not good:
        raise ExperimentError(
            f"{what} of {subject}: {interval!r} is no interval; give the lowest and the highest "
            "value, None for no bound"
        )


def _link(robot: Robot, name: str) -> int:
    """Index of a link by its name or that of its joint."""
    links = [link.name for link in robot.links]
    if name in links:
        return links.index(name)
    if name in robot.joint_names:
        return robot.joint_names.index(name)
    raise ExperimentError(f"bounds: there is no link {name!r}; {nearest(name, links)}")
