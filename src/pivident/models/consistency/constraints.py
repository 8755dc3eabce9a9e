"""Conditions for physically possible parameters, as linear images of cones.

* every link: mass and second moments about its own centre of mass are at least those of a small
  steel ball, see `least_body`;
* drives: the matrix of rotor inertias, with coupled motors, is positive semidefinite, since
  ½ dqᵀ I dq is the rotors' kinetic energy; the same for viscous friction, whose power is
  dqᵀ F dq;
* other dissipative terms are not negative;
* bounds that the user declares.

A coupled motor adds ratio·iam between two joints (see `Coupling`): [[ia5, r iam6], [r iam6, ia6]]
on the TX40's wrist.

Plausible masses are within a factor of the reference's, unless the user or the data say otherwise.
Descriptions of vendors have a whole arm right to some percent, since somebody weighs it, and single
links to some tens of percent; bodies of the geometry alone are off by a factor of a few. A
plausible body fits its link: with R how far the link reaches from its middle c by its joints, or
what its own description says if that is more, ∫ |x - c|² dm ≤ m R². These bounds apply to the
choice among near parameters only (see `nearest_consistent`); least distance and intervals do not
use them, since they are no knowledge of the machine.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from pivident.dynamics.parameters import Parameter
from pivident.foundation.errors import ExperimentError, RobotDescriptionError
from pivident.models.consistency.cone_program import Cone
from pivident.models.consistency.pseudo_inertia import BASIS, least_body, pseudo_inertia, triangle
from pivident.models.consistency.reference import Reference, body_links, link_places, link_spheres
from pivident.robot.description import Robot
from pivident.robot.naming import nearest

#: Lowest and highest value; None: no bound on that side.
Interval = tuple[float | None, float | None]


@dataclass(frozen=True)
class Bounds:
    """Declared bounds of masses and centres of mass, by the name of the link.

    Attributes:
        mass: lowest and highest mass of a link [kg].
        total_mass: lowest and highest total mass of all moving links [kg].
        center_of_mass: box around a link's centre of mass in its frame: an interval for x, y, z
            [m].
        ellipsoid: ellipsoid around a link's centre of mass: its centre (x, y, z) and its half axes
            along the axes of the frame [m].
    """

    mass: Mapping[str, Interval] = field(default_factory=dict)
    total_mass: Interval | None = None
    center_of_mass: Mapping[str, tuple[Interval, Interval, Interval]] = field(default_factory=dict)
    ellipsoid: Mapping[str, tuple[Sequence[float], Sequence[float]]] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Constraint:
    """One condition on the standard parameters, F φ + g ∈ K."""

    subject: str  # its link or joint, or ``all links``
    kind: str  # the condition in words
    cone: Cone  # kind of K
    order: int  # order of the matrices of a semidefinite cone; otherwise the number of rows
    matrix: np.ndarray  # F, shape (rows, standard)
    offset: np.ndarray  # g, shape (rows,)
    is_declared: bool = False  # whether it is a bound declared by the user


#: Conditions on a link's second moments, see `WORDS` in `nearest_consistent`, and on its mass.
REAL_BODY, LEAST_MASS = "a real body", "mass at its limit: that of the smallest body"


def place_of_link(robot: Robot, name: str) -> int:
    """Row of `link_places` of a link by its name or that of its joint.

    Raises:
        RobotDescriptionError: there is no such link, or it is no body; names the nearest ones.
    """
    tree, bodies = robot.tree, body_links(robot)
    index = tree.link_index(name)
    if index not in bodies:
        raise RobotDescriptionError(
            f"link {tree.links[index].name!r} is a frame without a body",
            advice=nearest(name, [tree.links[i].name for i in bodies]),
        )
    return bodies.index(index)


def make_constraints(
    robot: Robot,
    standard: Sequence[Parameter],
    reference: Reference,
    bounds: Bounds | None = None,
) -> tuple[Constraint, ...]:
    """All conditions."""
    declared = _declared(robot, standard, reference, bounds or Bounds())
    return (
        *_real_bodies(robot, standard, reference),
        *_positive_forms(robot, standard, reference),
        *_dissipative(robot, standard, reference),
        *(replace(c, is_declared=True) for c in declared),
    )


def _real_bodies(
    robot: Robot, standard: Sequence[Parameter], reference: Reference
) -> Iterator[Constraint]:
    """P̃ - Ẽ ≥ 0 of each link, on the scale of its reference, and m ≥ m_b; see `least_body`."""
    links = [robot.tree.links[i].name for i in body_links(robot)]
    for i, place in enumerate(link_places(robot, standard)):
        matrix = np.zeros((10, len(standard)))
        matrix[:, place] = triangle(reference.scaled(i, BASIS)).T
        least, lightest = least_body(float(reference.diameters[i]))
        offset = -triangle(reference.scaled(i, least))
        name = links[i]
        yield from [
            Constraint(name, REAL_BODY, "semidefinite", 4, matrix, offset),
            _at_least(name, LEAST_MASS, place[9:], lightest, reference),
        ]


def _positive_forms(
    robot: Robot, standard: Sequence[Parameter], reference: Reference
) -> Iterator[Constraint]:
    """Positive semidefinite matrices of rotor inertia and of viscous friction of coupled joints."""
    for own, coupled, kind in (
        ("ia", "iam", "rotor inertias of coupled motors physically possible"),
        ("fv", "fvm", "viscous friction of coupled motors dissipative"),
    ):
        diagonal = {p.joint: k for k, p in enumerate(standard) if p.stem == own}
        for joints in coupled_joints(robot.tree):
            if not all(j in diagonal for j in joints):
                continue  # another friction law: its terms are constrained one by one
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
            subject = " and ".join(robot.tree.joints[j].name for j in joints)
            yield Constraint(subject, kind, "semidefinite", size, rows.T, np.zeros(rows.shape[1]))


def coupled_joints(robot: Robot) -> list[tuple[int, ...]]:
    """Groups of joints whose motors are coupled, ascending."""
    groups: list[set[int]] = []
    for c in robot.couplings:
        touching = [g for g in groups if g & {c.motor, c.joint}]
        groups = [g for g in groups if g not in touching] + [{c.motor, c.joint}.union(*touching)]
    return [tuple(sorted(g)) for g in groups]


def _dissipative(
    robot: Robot, standard: Sequence[Parameter], reference: Reference
) -> Iterator[Constraint]:
    """Non-negative friction levels and rotor inertias."""
    for k, p in enumerate(standard):
        if p.is_dissipative:
            name, kind = robot.tree.joints[p.joint].name, f"{p.name} not negative"
            yield _at_least(name, kind, np.array([k]), 0.0, reference)


def _at_least(
    subject: str, kind: str, places: np.ndarray, bound: float, reference: Reference, sign: int = 1
) -> Constraint:
    """Σ φ ≥ bound; ≤ with the sign -1."""
    scale = float(reference.scales[places].sum())
    matrix = np.zeros((1, reference.scales.size))
    matrix[0, places] = sign / scale
    return Constraint(subject, kind, "nonnegative", 1, matrix, np.array([-sign * bound / scale]))


def _declared(
    robot: Robot, standard: Sequence[Parameter], reference: Reference, bounds: Bounds
) -> Iterator[Constraint]:
    """The user's bounds."""
    places = link_places(robot, standard)
    for name, interval in bounds.mass.items():
        mass = places[place_of_link(robot, name), 9:]
        yield from mass_interval(name, "mass", interval, mass, reference)
    if bounds.total_mass is not None:
        yield from mass_interval(TOTAL, "total mass", bounds.total_mass, places[:, 9], reference)
    for name, box in bounds.center_of_mass.items():
        place = places[place_of_link(robot, name)]
        if len(box) != 3:
            raise ExperimentError(
                f"center_of_mass of link {name!r} needs three intervals, for x, y, z",
                advice=f"it has {len(box)}",
            )
        for axis, interval in enumerate(box):
            yield from _box(name, axis, interval, place, len(standard), reference)
    for name, (center, axes) in bounds.ellipsoid.items():
        place = places[place_of_link(robot, name)]
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
        yield Constraint(
            name, "centre of mass in its ellipsoid", "second_order", 4, matrix, np.zeros(4)
        )


def mass_interval(
    subject: str,
    what: str,
    interval: Interval,
    places: np.ndarray,
    reference: Reference,
) -> Iterator[Constraint]:
    """Lowest ≤ Σ φ ≤ highest [kg], ``places`` the indices of the masses.

    Raises:
        ExperimentError: bounds that are not an interval.
    """
    _check(subject, what, interval)
    for bound, sign, words in zip(interval, (1, -1), ("at least", "at most"), strict=True):
        if bound is not None:
            kind = f"{what} {words} {bound:.4g} kg"
            yield _at_least(subject, kind, places, bound, reference, sign)


def _box(
    name: str,
    axis: int,
    interval: Interval,
    place: np.ndarray,
    size: int,
    reference: Reference,
) -> Iterator[Constraint]:
    """Lowest · m ≤ h ≤ highest · m."""
    label = "xyz"[axis]
    _check(name, f"center_of_mass {label}", interval)
    scale = reference.scales[place[6]]
    for bound, sign, words in zip(interval, (1.0, -1.0), ("at least", "at most"), strict=True):
        if bound is None:
            continue
        matrix = np.zeros((1, size))
        matrix[0, place[6 + axis]] = sign / scale
        matrix[0, place[9]] = -sign * bound / scale
        kind = f"centre of mass {label} {words} {bound:g} m"
        yield Constraint(name, kind, "nonnegative", 1, matrix, np.zeros(1))


def _check(subject: str, what: str, interval: Interval) -> None:
    """Refuse bounds that are not an interval."""
    try:
        low, high = interval
        numbers = [float(b) for b in (low, high) if b is not None]
        good = bool(np.isfinite(numbers).all()) and (len(numbers) < 2 or numbers[0] < numbers[1])
    except (TypeError, ValueError):
        good = False
    if not good:
        raise ExperimentError(
            f"{what} of {subject}: {interval!r} is not an interval",
            advice="give the lowest and the highest value, None for no bound",
        )


#: Largest mass of a link over that of the description, and least under it; the same of the total.
MAX_FACTOR, MAX_TOTAL_FACTOR = 3.0, 1.15

#: The same for bodies of the geometry alone.
MAX_ASSUMED_FACTOR, MAX_ASSUMED_TOTAL_FACTOR = 10.0, 4.0

#: Share of the arm's mass that may be mounted on any link: a tool, cables, a gripper.
MOUNTED = 0.1

#: Distance of a described link's mass from its middle, in root mean squares, that it may have.
MAX_RADIUS_FACTOR = 1.5

#: Distance of the total mass from its limit, as a share of it, that counts as none.
AT_LIMIT = 1e-4

#: What bounds of all masses together are about.
TOTAL = "all links"


def plausible_bodies(
    robot: Robot,
    standard: Sequence[Parameter],
    reference: Reference,
    bounds: Bounds | None = None,
    has_scale: bool = True,
) -> tuple[Constraint, ...]:
    """Bounds of every body's size, of its mass and of their total, where the user declares none.

    ``has_scale``: whether the torques are known to be in N m; masses mean nothing otherwise.
    """
    sizes = _sizes(robot, standard, reference)
    return (
        (*sizes, *_masses(robot, standard, reference, bounds or Bounds())) if has_scale else sizes
    )


def _sizes(
    robot: Robot, standard: Sequence[Parameter], reference: Reference
) -> tuple[Constraint, ...]:
    """∫ |x - c|² dm ≤ m R² of each body."""
    spheres, made = link_spheres(robot), []
    image = np.array([pseudo_inertia(unit) for unit in np.eye(10)])
    for i, place in zip(body_links(robot), link_places(robot, standard), strict=True):
        middle, radius = spheres[i]
        spread = np.trace(image[:, :3, :3], axis1=1, axis2=2) - 2.0 * image[:, :3, 3] @ middle
        spread += middle @ middle * image[:, 3, 3]
        mass = max(float(reference.values[place[9]]), 1e-300)
        own = max(float(spread @ reference.values[place]) / mass, 0.0)
        radius = max(radius, MAX_RADIUS_FACTOR * float(np.sqrt(own)))
        matrix = np.zeros((1, len(standard)))
        matrix[0, place] = image[:, 3, 3] - spread / radius**2
        matrix /= mass
        kind = f"its mass within {radius:.2g} m of its middle"
        name = robot.tree.links[i].name
        made.append(Constraint(name, kind, "nonnegative", 1, matrix, np.zeros(1)))
    return tuple(made)


def _masses(
    robot: Robot, standard: Sequence[Parameter], reference: Reference, declared: Bounds
) -> Iterator[Constraint]:
    """Bounds of every mass and of their total."""
    places = link_places(robot, standard)
    own = {place_of_link(robot, name) for name in declared.mass}
    names = [robot.tree.links[i].name for i in body_links(robot)]
    masses = reference.values[places[:, 9]]
    mounted = MOUNTED * float(masses.sum())
    for i, place in enumerate(places):
        if i not in own:
            factor = MAX_ASSUMED_FACTOR if reference.assumed[i] else MAX_FACTOR
            least, most = masses[i] / factor, max(masses[i] * factor, masses[i] + mounted)
            yield from mass_interval(names[i], "mass", (least, most), place[9:], reference)
    if declared.total_mass is None and not own:
        factors = np.where(reference.assumed, MAX_ASSUMED_TOTAL_FACTOR, MAX_TOTAL_FACTOR)
        total = float((masses / factors).sum()), float((masses * factors).sum())
        yield from mass_interval(TOTAL, "total mass", total, places[:, 9], reference)


def total_at_its_limit(
    plausible: Sequence[Constraint], values: np.ndarray, described: np.ndarray
) -> tuple[str, ...]:
    """What to declare where a plausible total mass decides, a sentence; empty where none does.

    ``values``: of the standard parameters; ``described``: those of the reference.
    """
    for own in plausible:
        left = float((own.matrix @ values + own.offset)[0])
        if own.subject == TOTAL and abs(left) < AT_LIMIT:
            masses = np.abs(own.matrix[0]) > 0.0
            return (
                f"All links weigh {values[masses].sum():.4g} kg together, at the limit of what is "
                f"plausible beside the description's {described[masses].sum():.4g} kg: the torques "
                "hardly determine it. If you know the mass of the moving arm, give it: total_mass "
                "= [lowest, highest] under [consistency]",
            )
    return ()
