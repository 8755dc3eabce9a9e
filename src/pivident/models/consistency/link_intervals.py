"""Intervals of a link's mass, centre of mass and principal moments.

Over the consistent sets that the record allows (see `profile_intervals`),

* the mass is linear in the parameters, as are the moments of inertia about the *fixed* principal
  axes of the consistent body, three axes through its centre of mass. The value is the principal
  moment, and the interval is that of the inertia about this axis;
* a coordinate of the centre of mass is the ratio h/m. With s = m*/m, m* the mass of the consistent
  body, and y = s φ, the largest ratio is a cone program again (Charnes, Cooper 1962), since all
  conditions scale: h(y)/m* where m(y) = m*. If the mass may be close to zero, its centre may be
  anywhere; ends beyond the reach of the arm count as open.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from pivident.models.consistency.cone_program import Requirement
from pivident.models.consistency.constraints import Constraint
from pivident.models.consistency.link_quantities import LinkRow, Quantity
from pivident.models.consistency.nearest_consistent import StandardSpace, imposed
from pivident.models.consistency.profile_intervals import allowed, lowest, profile_intervals
from pivident.models.consistency.pseudo_inertia import moment_about_axis, principal_axes

if TYPE_CHECKING:
    from pivident.models.consistency.consistent_model import ConsistentModel

#: Distance beyond the reach of the arm up to which centres of mass are searched [m].
REACH = 1.0


def link_rows(model: ConsistentModel, confidence: float = 0.95) -> tuple[LinkRow, ...]:
    """All links with their intervals."""
    space, constraints, values = model._space, model._constraints, model.values
    reach = REACH + sum(float(np.linalg.norm(j.translation)) for j in model.robot.tree.joints)
    bodies = model.links
    axes = [principal_axes(body) for body in bodies]
    directions = np.zeros((len(bodies), 4, values.size))
    for own, place, body, turned in zip(directions, space.links, bodies, axes, strict=True):
        own[0, place[9]] = 1.0
        for k in range(3):
            own[1 + k, place] = moment_about_axis(body.center_of_mass, turned[:, k])
    ends = profile_intervals(
        space, constraints, model.least_distance, directions.reshape(-1, values.size), confidence
    )
    low, high = (end.reshape(len(bodies), 4) for end in ends)
    rows = []
    for i, (place, body) in enumerate(zip(space.links, bodies, strict=True)):
        mass, *moments = (
            Quantity(float(v), float(a), float(b))
            for v, a, b in zip((body.mass, *body.principal_moments), low[i], high[i], strict=True)
        )
        center = center_of_mass_range(
            space, constraints, place, body.mass, model.least_distance, confidence, reach
        )
        x, y, z = (
            Quantity(float(c), float(a), float(b))
            for c, a, b in zip(body.center_of_mass, *center, strict=True)
        )
        a, b, c = moments
        rows.append(LinkRow(body.name, mass, (x, y, z), (a, b, c), axes[i], values[place]))
    return tuple(rows)


def center_of_mass_range(
    space: StandardSpace,
    constraints: Sequence[Constraint],
    place: np.ndarray,
    mass: float,
    least_distance: float,
    confidence: float,
    reach: float,
) -> tuple[np.ndarray, np.ndarray]:
    """Smallest and largest h/m of a link, coordinate by coordinate [m], each (3,).

    ``place``: indices of the link's ten inertial parameters. Infinite beyond ``reach``, NaN where
    the solver finds none.
    """
    size = space.slope.shape[1]
    conditions = (*imposed(space, constraints), allowed(space, least_distance, confidence))
    requirements = [_homogeneous(r, size) for r in conditions]
    rows = np.c_[space.slope[place[6:]], space.start[place[6:]]] / mass  # mx my mz m over (y, s)
    requirements += [
        Requirement("nonnegative", 1, np.eye(1, size + 1, size), np.zeros(1)),
        Requirement("zero", 1, rows[3:], -np.ones(1)),
    ]
    box = np.r_[rows[:3], -rows[:3]] / reach
    requirements.append(Requirement("nonnegative", 6, -box, np.ones(6)))
    low, high = np.empty((2, 3))
    for axis in range(3):
        scale = float(np.abs(rows[axis]).max()) or 1.0
        for ends, sign in ((low, 1.0), (high, -1.0)):
            solved = lowest(sign * rows[axis] / scale, requirements)
            end = rows[axis] @ solved.u if solved.found else np.nan
            ends[axis] = -sign * np.inf if solved.unbounded or abs(end) > 0.99 * reach else end
    return low, high


def _homogeneous(requirement: Requirement, size: int) -> Requirement:
    """F u + g ∈ K as F y + g s ∈ K, with y = s u."""
    matrix = np.zeros((requirement.offset.size, size + 1))
    columns = requirement.columns
    width = requirement.matrix.shape[1]
    matrix[:, np.arange(width) if columns is None else columns] = requirement.matrix
    matrix[:, size] = requirement.offset
    return Requirement(
        requirement.cone, requirement.order, matrix, np.zeros(requirement.offset.size)
    )
