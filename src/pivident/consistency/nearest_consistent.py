"""The consistent parameters nearest to an estimate, by two or three small semidefinite programs.

Standard parameters are φ = φ(x, z): x are the base parameters' distances from the estimate in
standard errors (see `metric`), z the standard parameters that the torques do not determine. First

    d*² = min |x|²    over the consistent φ(x, z),

then, among the points with |x|² ≤ d*² + room, the one nearest to the reference (see `priors`).
If the estimate itself is consistent, x = 0, and only z is searched.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pivident.consistency.cone_program import (
    Requirement,
    Solved,
    solve_cone_program,
    violation,
)
from pivident.consistency.constraints import REAL_BODY, Constraint, link_places
from pivident.consistency.metric import Metric
from pivident.consistency.priors import prior_terms
from pivident.consistency.pseudo_inertia import from_triangle
from pivident.consistency.reference import Reference
from pivident.errors import ContradictoryBounds, IdentificationError
from pivident.robot.description import Robot

#: Distance below which an estimate is consistent: a thousandth of a standard error.
CONSISTENT = 1e-3

#: Growth of d² that is left to the prior: one unit of χ², the standard error of a single parameter.
#: With a hundredth the result would be close to the nearest point itself, where bodies degenerate:
#: links whose mass is a point, at no smaller torque error (TX40 record).
ROOM = 1.0

#: The same relative to d², within the accuracy of the solver.
RELATIVE_ROOM = 1e-4

#: Weak pull of the undetermined parameters to the reference, so that the first program has a unique
#: solution; parameters z times the reference change d² by that times z². Stronger ones are tried if
#: the solver fails.
PULLS = (1e-8, 1e-6, 1e-4)

#: Largest violation of a constraint, on the scale of the reference.
OUTSIDE = 1e-5

#: Accuracy of the prior's choice, which is arbitrary anyway; the second one is the fallback.
CHOICE_GAPS = (1e-5, 1e-2)

#: Multiplier below which a constraint is not active, relative to the largest.
INACTIVE = 1e-4


#: Limits of a link by the number of directions of its multiplier.
WORDS = {
    1: "smallest principal second moment at its limit: its mass in a plane",
    2: "two principal second moments at their limits: its mass on a line",
    3: "all second moments at their limits: its mass in a point",
}


@dataclass(frozen=True, eq=False)
class Active:
    """An active constraint."""

    subject: str  # link or joint
    constraint: str  # the limit in words
    multiplier: float  # growth of d²/2 per unit of the constraint on the scale of the reference
    share: float  # part of d² that is due to it; all shares together are 1

    def __str__(self) -> str:
        return f"{self.subject}: {self.constraint} ({100 * self.share:.0f} % of the distance)"


@dataclass(frozen=True, eq=False)
class StandardSpace:
    """Standard parameters as φ = start + slope · (x, z)."""

    start: (
        np.ndarray
    )  # at the estimate, undetermined parameters at the reference, shape (standard,)
    slope: np.ndarray  # shape (standard, base + undetermined)
    distances: int  # number of unknowns x
    links: np.ndarray  # indices of each link's inertial parameters, shape (joints, 10)

    def values(self, u: np.ndarray) -> np.ndarray:
        """Standard parameters at u = (x, z), shape (standard,)."""
        return self.start + self.slope @ u


@dataclass(frozen=True, eq=False)
class Nearest:
    """The nearest consistent parameters."""

    values: np.ndarray  # standard parameters, shape (standard,)
    least_distance: float  # d* [σ]; zero where the estimate was consistent
    distance: float  # that of the values, √(d*² + room) at most [σ]
    was_consistent: bool  # whether the estimate itself was
    active: tuple[Active, ...]  # active constraints, the most expensive first
    directions: int  # number of directions of the base parameters that they fix
    notes: tuple[str, ...] = ()  # sentences


def standard_space(robot: Robot, metric: Metric, reference: Reference) -> StandardSpace:
    """Standard parameters over distances and undetermined ones.

    With K the regrouping of the base parameters, β = φ_kept + K φ_dropped.
    """
    base = metric.base
    free = np.r_[base.dropped, base.without_effect]
    size = len(base)
    start = np.zeros(len(base.standard))
    slope = np.zeros((start.size, size + free.size))
    start[free] = reference.values[free]
    slope[free, size + np.arange(free.size)] = reference.scales[free]
    start[base.kept] = metric.center - base.regrouping @ start[base.dropped]
    slope[base.kept, :size] = metric.root
    slope[base.kept, size:] = -base.regrouping @ slope[base.dropped, size:]
    return StandardSpace(start, slope, size, link_places(robot, base.standard))


def nearest_consistent(
    space: StandardSpace,
    constraints: Sequence[Constraint],
    reference: Reference,
    prior: str,
    room: float = ROOM,
) -> Nearest:
    """The nearest consistent parameters; ``room`` is the growth of d² that is left to the prior."""
    requirements = imposed(space, constraints)
    closest = _closest(space, requirements, constraints)
    x = closest.u[: space.distances]
    least = float(np.linalg.norm(x))
    if least < CONSISTENT:
        kept = _nearest_to_reference(space, constraints, reference, prior, None)
        if kept.found:
            undetermined = kept.u[: space.slope.shape[1] - space.distances]
            u = np.r_[np.zeros(space.distances), undetermined]
            return Nearest(space.values(u), 0.0, 0.0, True, (), 0)
    radius = np.sqrt(least**2 * (1.0 + RELATIVE_ROOM) + room)
    found = _nearest_to_reference(space, constraints, reference, prior, float(radius))
    notes: tuple[str, ...] = ()
    u = found.u[: space.slope.shape[1]]
    if not found.found:
        u = closest.u
        notes = (
            f"The search with the prior {prior!r} ended with {found.status}: the solver's own "
            "choice among the nearest parameters was used",
        )
    active, directions = active_constraints(space, constraints, closest)
    distance = float(np.linalg.norm(u[: space.distances]))
    return Nearest(space.values(u), least, distance, False, active, directions, notes)


def imposed(
    space: StandardSpace, constraints: Sequence[Constraint], without_distance: bool = False
) -> list[Requirement]:
    """The constraints on u = (x, z), or on z alone where x = 0."""
    slope = space.slope[:, space.distances :] if without_distance else space.slope
    return [
        Requirement(c.cone, c.order, c.matrix @ slope, c.matrix @ space.start + c.offset)
        for c in constraints
    ]


def within_distance(space: StandardSpace, radius: float) -> Requirement:
    """The condition |x| ≤ radius [σ]."""
    size = space.distances
    return Requirement(
        "second_order", size + 1, np.eye(size + 1, size, -1), np.r_[radius, np.zeros(size)]
    )


def _closest(
    space: StandardSpace, requirements: Sequence[Requirement], constraints: Sequence[Constraint]
) -> Solved:
    """The least |x|."""
    quadratic = np.empty(space.slope.shape[1])
    for pull in PULLS:
        quadratic[:] = pull
        quadratic[: space.distances] = 1.0
        solved = solve_cone_program(quadratic, np.zeros(quadratic.size), requirements)
        if solved.infeasible:
            words = [f"{c.subject}: {c.kind}" for c in constraints if c.is_declared]
            raise ContradictoryBounds(words)
        if solved.found and violation(requirements, solved.u) < OUTSIDE:
            return solved
    raise IdentificationError(
        f"the search for consistent parameters ended with {solved.status}; the covariance of "
        "the estimate may span too many orders of magnitude, identify fewer parameters"
    )


def _nearest_to_reference(
    space: StandardSpace,
    constraints: Sequence[Constraint],
    reference: Reference,
    prior: str,
    radius: float | None,
) -> Solved:
    """The prior's choice among the points within a distance; None: at distance zero."""
    requirements = imposed(space, constraints, without_distance=radius is None)
    slope = space.slope[:, space.distances :] if radius is None else space.slope
    if radius is not None:
        requirements.append(within_distance(space, radius))
    terms = prior_terms(prior, reference, space.links, slope, space.start)
    requirements += terms.requirements
    for gap in CHOICE_GAPS:
        solved = solve_cone_program(terms.quadratic, terms.linear, requirements, gap)
        if solved.found or solved.infeasible:
            break
    return solved


def active_constraints(
    space: StandardSpace, constraints: Sequence[Constraint], closest: Solved
) -> tuple[tuple[Active, ...], int]:
    """Constraints with a multiplier, and the number of directions of x that they fix.

    At the solution x = Σ F_xᵀ y over the constraints' multipliers y and Σ F_zᵀ y = 0, so d² is the
    sum of ⟨y, F_x x⟩: each constraint's share.
    """
    x = closest.u[: space.distances]
    squared = max(float(x @ x), 1e-300)
    moved = space.slope[:, : space.distances] @ x
    largest = max(float(np.linalg.norm(y)) for y in closest.multipliers)
    found, normals = [], []
    for c, y in zip(constraints, closest.multipliers, strict=True):
        size = float(np.linalg.norm(y))
        if size <= INACTIVE * largest:
            continue
        rows, words = _at_the_limit(c, y)
        normals.append(rows @ space.slope)
        share = float(y @ (c.matrix @ moved)) / squared
        found.append(Active(c.subject, words, size, share))
    ordered = sorted(found, key=lambda a: -a.share)
    return tuple(ordered), _directions(np.concatenate(normals), space.distances)


def _at_the_limit(constraint: Constraint, multiplier: np.ndarray) -> tuple[np.ndarray, str]:
    """Rows on the standard parameters that an active constraint fixes, and its text.

    A matrix that is singular along the columns of V fixes the entries of Vᵀ P V.
    """
    if constraint.cone != "semidefinite":
        return (multiplier @ constraint.matrix)[None], constraint.kind
    values, vectors = np.linalg.eigh(from_triangle(multiplier, constraint.order))
    singular = vectors[:, values > INACTIVE * values[-1]]
    rank = singular.shape[1]
    held = singular.T @ from_triangle(constraint.matrix.T, constraint.order) @ singular
    row, column = np.triu_indices(rank)
    rows = held[:, row, column].T
    return rows, WORDS[min(rank, 3)] if constraint.kind == REAL_BODY else constraint.kind


def _directions(normals: np.ndarray, distances: int) -> int:
    """Number of directions of x fixed by active constraints that z cannot compensate."""
    lengths = np.linalg.norm(normals, axis=1)
    normals = normals[lengths > 0.0] / lengths[lengths > 0.0, None]
    both = np.linalg.matrix_rank(normals, tol=1e-6)
    return int(both - np.linalg.matrix_rank(normals[:, distances:], tol=1e-6))
