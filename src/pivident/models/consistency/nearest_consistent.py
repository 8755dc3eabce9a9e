"""The consistent parameters nearest to an estimate, by two or three small semidefinite programs.

Standard parameters are φ = φ(x, z): x are the base parameters' distances from the estimate in
standard errors (see `metric`), z the standard parameters that the torques do not determine. First

    d*² = min |x|²    over the consistent φ(x, z),

at a point x* where bodies degenerate to points, lines and plates. Then, with D the distance to the
reference (see `priors`),

    min ½ |x|² + D(φ)    over the consistent φ(x, z) with  |x|² ≤ d*² + room
                         and  |θ_k - θ*_k| ≤ r_k σ_k ,

r_k = σ_k/|θ_k| between 0.1 and 1: a parameter that the data determine to a tenth of its value or
better keeps the value of the nearest point to a tenth of its standard error, and where they say
nothing the reference decides. If the estimate itself is consistent, x = 0, and only z is searched.

Bodies of the chosen point that are not plausible (see `plausible_bodies`) are made so if the least
distance to consistent parameters with plausible bodies is not significantly larger, or the torque
error does not show it: standard errors of measured records contain little model error, and a
direction that no torque shows has no other knowledge than these bodies. Where both are larger, all
but the total mass are tried, and at last the sizes alone.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from pivident.foundation.common_work import once
from pivident.foundation.errors import ContradictoryBounds, IdentificationError
from pivident.foundation.text.numbers import format_significant
from pivident.models.consistency.cone_program import (
    Requirement,
    Solved,
    solve_cone_program,
    violation,
)
from pivident.models.consistency.constraints import REAL_BODY, TOTAL, Constraint
from pivident.models.consistency.metric import HALF_INTERVAL, NOTABLE_COST, Metric
from pivident.models.consistency.priors import prior_terms
from pivident.models.consistency.pseudo_inertia import from_triangle
from pivident.models.consistency.reference import Reference, link_places
from pivident.robot.description import Robot

#: Distance below which an estimate is consistent: a thousandth of a standard error.
CONSISTENT = 1e-3

#: Growth of d² that is left to the prior: that of a 95 % interval, so that every chosen value lies
#: within its interval. With a hundredth the result would be close to the nearest point itself,
#: where bodies degenerate, at no smaller torque error (TX40 record).
ROOM = HALF_INTERVAL**2

#: Share of it that is left where plausible bodies take the rest.
LEAST_ROOM = 0.01

#: Smallest and largest move of a parameter by the prior [σ]; between them σ/|θ|.
LEAST_MOVE, MOST_MOVE = 0.1, 1.0

#: The same relative to d², within the accuracy of the solver.
RELATIVE_ROOM = 1e-4

#: Weak pull of the undetermined parameters to the reference, so that the first program has a unique
#: solution; parameters z times the reference change d² by that times z². Stronger ones are tried if
#: the solver fails.
PULLS = (1e-8, 1e-6, 1e-4, 1e-2)

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
    links: np.ndarray  # indices of each body's inertial parameters, shape (bodies, 10)
    # rotor inertias and friction that torques do not determine: the prior pulls them too
    pulled: np.ndarray
    moves: np.ndarray  # (θ - θ_free)/σ of the estimated parameters over x, (parameters, base)
    allowed_moves: np.ndarray  # largest move of each by the prior [σ], shape (parameters,)

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
    # a pull on rotors and friction that torques determine would compete with that on the bodies
    others = np.array([not p.is_inertial for p in base.standard])
    pulled = np.flatnonzero(others & slope[:, size:].any(axis=1))
    moves = metric.root[metric.estimated]
    std = np.linalg.norm(moves[:, metric.estimated], axis=1)
    relative = std / np.maximum(np.abs(metric.center[metric.estimated]), std)
    return StandardSpace(
        start,
        slope,
        size,
        link_places(robot, base.standard),
        pulled,
        moves / std[:, None],
        np.clip(relative, LEAST_MOVE, MOST_MOVE),
    )


def nearest_consistent(
    space: StandardSpace,
    constraints: Sequence[Constraint],
    reference: Reference,
    prior: str,
    plausible: Sequence[Constraint] = (),
    room: float = ROOM,
    torque_error: Callable[[np.ndarray], float] = lambda values: np.nan,
) -> Nearest:
    """The nearest consistent parameters; ``room`` is the growth of d² that is left to the prior.

    Conditions that are ``plausible`` restrict the choice unless the data contradict them;
    ``torque_error``: of standard parameters on the fitted record, NaN where it is not known.
    """
    closest = _closest(space, constraints)
    least = float(np.linalg.norm(closest.u[: space.distances]))
    if least < CONSISTENT:
        kept = _kept(space, constraints, reference, prior)
        if kept.found and (outside := _violated(space, plausible, _wide(space, kept.u))):
            within = _kept(space, [*constraints, *plausible], reference, prior)
            kept, notes = (within, ()) if within.found else (kept, _implausible(outside, None))
        else:
            notes = ()
        if kept.found:
            return Nearest(space.values(_wide(space, kept.u)), 0.0, 0.0, True, (), 0, notes)
        room *= LEAST_ROOM  # a solver that cannot keep the distance at zero keeps it small
    u, notes = _chosen(space, constraints, reference, prior, room, closest)
    if outside := _violated(space, plausible, u):
        farther = None
        allowed = (1.0 + NOTABLE_COST) * torque_error(space.values(u))
        for some in _fewer(plausible):
            every = [*constraints, *some]
            within = _closest(space, every)
            growth = float(np.sum(within.u[: space.distances] ** 2)) - least**2
            farther = farther or np.sqrt(max(growth, 0.0))
            left = room if growth > room else max(room - growth, LEAST_ROOM * room)
            chosen = _chosen(space, every, reference, prior, left, within)
            unseen = torque_error(space.values(chosen[0])) <= allowed
            failed = bool(notes) and not chosen[1]  # what they are compared with is nobody's choice
            if growth <= HALF_INTERVAL**2 or unseen or failed:
                u, notes = chosen
                outside = [c for c in outside if c not in some]
                break
        if outside:
            notes = (*notes, *_implausible(outside, farther))
    active, directions = active_constraints(space, constraints, closest)
    distance = float(np.linalg.norm(u[: space.distances]))
    return Nearest(space.values(u), least, distance, least < CONSISTENT, active, directions, notes)


def _fewer(plausible: Sequence[Constraint]) -> list[Sequence[Constraint]]:
    """All plausible conditions, those of single links, and those of sizes."""
    own = [c for c in plausible if c.subject != TOTAL]
    return [plausible, own, [c for c in own if "mass at" not in c.kind]]


def _wide(space: StandardSpace, undetermined: np.ndarray) -> np.ndarray:
    """(0, z), the point at distance zero; further unknowns of the prior are left out."""
    free = space.slope.shape[1] - space.distances
    return np.r_[np.zeros(space.distances), undetermined[:free]]


def _violated(
    space: StandardSpace, conditions: Sequence[Constraint], u: np.ndarray
) -> list[Constraint]:
    """Linear conditions that a point does not satisfy."""
    values = space.values(u)
    return [c for c in conditions if (c.matrix @ values + c.offset).min() < -OUTSIDE]


def _implausible(outside: Sequence[Constraint], farther: float | None) -> tuple[str, ...]:
    """A sentence about bounds that the data contradict."""
    words = "; ".join(f"{c.subject}: {c.kind}" for c in outside)
    growth = "" if farther is None else f" by {format_significant(farther)} σ"
    return (
        f"The data contradict plausible bodies{growth} ({words}), so they were not imposed: "
        "check torque constants, gear ratios and the description's masses, or declare a mass in "
        "[consistency.bounds], or total_mass under [consistency], where you know it",
    )


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


def _closest(space: StandardSpace, constraints: Sequence[Constraint]) -> Solved:
    """The least |x|, which searches with different room have in common."""
    key = ("nearest parameters", space, *constraints)
    return once(key, lambda: _least(space, imposed(space, constraints), constraints))


def _least(
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
        f"the search for consistent parameters ended with {solved.status}",
        advice="the covariance of the estimate may span too many orders of magnitude, identify "
        "fewer parameters",
    )


def _kept(
    space: StandardSpace, constraints: Sequence[Constraint], reference: Reference, prior: str
) -> Solved:
    """The prior's choice at distance zero: z alone."""
    slope = space.slope[:, space.distances :]
    terms = prior_terms(prior, reference, space.links, slope, space.start, space.pulled)
    requirements = [*imposed(space, constraints, without_distance=True), *terms.requirements]
    return _solved(terms.quadratic, terms.linear, requirements)


def _chosen(
    space: StandardSpace,
    constraints: Sequence[Constraint],
    reference: Reference,
    prior: str,
    room: float,
    closest: Solved,
) -> tuple[np.ndarray, tuple[str, ...]]:
    """The prior's choice near the nearest point, u and notes."""
    nearest = closest.u[: space.distances]
    size = space.distances
    terms = prior_terms(prior, reference, space.links, space.slope, space.start, space.pulled)
    squared = float(nearest @ nearest) * (1.0 + RELATIVE_ROOM) + room
    requirements = [
        *imposed(space, constraints),
        *terms.requirements,
        within_distance(space, float(np.sqrt(squared))),
        _near(space, nearest),
    ]
    quadratic = terms.quadratic.copy()
    if prior != "none":
        quadratic[:size, :size] += np.eye(size)
    solved = _solved(quadratic, terms.linear, requirements)
    if solved.found:
        return solved.u[: space.slope.shape[1]], ()
    note = (
        f"The search with the prior {prior!r} ended with {solved.status}: the solver's own "
        "choice among the nearest parameters was used"
    )
    return closest.u, (note,)


def _near(space: StandardSpace, nearest: np.ndarray) -> Requirement:
    """No estimated parameter farther from the nearest point than the prior may move it."""
    at = space.moves @ nearest
    rows = np.r_[space.moves, -space.moves]
    offset = np.r_[space.allowed_moves - at, space.allowed_moves + at]
    return Requirement("nonnegative", offset.size, rows, offset)


def _solved(quadratic: np.ndarray, linear: np.ndarray, requirements: list[Requirement]) -> Solved:
    """The prior's choice to the accuracy that it deserves."""
    for gap in CHOICE_GAPS:
        solved = solve_cone_program(quadratic, linear, requirements, gap)
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
        found.append(Active(c.subject, words, size, float(y @ (c.matrix @ moved)) / squared))
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
