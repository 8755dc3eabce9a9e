"""Links of a consistent model as bodies: their quantities with intervals, and these as text.

Intervals of a link's mass, centre of mass and principal moments.

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

import math
from collections.abc import Sequence
from dataclasses import dataclass
from decimal import Decimal
from typing import TYPE_CHECKING

import numpy as np

from pivident.foundation.document.table import Column, Table, Values
from pivident.foundation.text.numbers import format_significant
from pivident.models.consistency.cone_program import Requirement
from pivident.models.consistency.constraints import Constraint
from pivident.models.consistency.nearest_consistent import StandardSpace, imposed
from pivident.models.consistency.profile_intervals import allowed, lowest, profile_intervals
from pivident.models.consistency.pseudo_inertia import LinkBody, moment_about_axis, principal_axes

if TYPE_CHECKING:
    from pivident.models.consistency.consistent_model import ConsistentModel


#: Text of an unbounded end, and of one that the solver did not find.
OPEN, NOT_FOUND = "open", "not found"

#: Fewest and most digits of printed moments of inertia.
LEAST_DIGITS, MOST_DIGITS = 3, 17


@dataclass(frozen=True)
class Quantity:
    """A value and its interval."""

    value: float  # at the consistent point
    low: float  # lower end; -∞ if unbounded, NaN if the solver found none
    high: float  # upper end


@dataclass(frozen=True, eq=False)
class LinkRow:
    """One link of the consistent robot."""

    name: str  # of the link
    mass: Quantity  # [kg]
    center_of_mass: tuple[Quantity, Quantity, Quantity]  # coordinates in the link's frame [m]
    # principal moments about the centre of mass, ascending [kg m²], with the intervals of the
    # moments about these axes
    moments: tuple[Quantity, Quantity, Quantity]
    # principal axes of the moments, as columns in the link's frame, shape (3, 3)
    axes: np.ndarray
    inertia: np.ndarray  # ten inertial parameters in the link's frame, shape (10,)


def link_table(bodies: Sequence[LinkBody], rows: Sequence[LinkRow] = ()) -> Table:
    """Links as bodies: mass, centre of mass, inertia about it in the link's frame and its moments.

    Args:
        bodies: the links.
        rows: the same with their intervals; empty: these are not known.
    """
    centres = np.array([body.center_of_mass for body in bodies])
    moments = np.array([body.principal_moments for body in bodies])
    texts = [moments_text(own) for own in moments]
    columns: dict[str, Column | Values] = {
        "link": [body.name for body in bodies],
        "mass_kg": Column(np.array([body.mass for body in bodies]), "mass [kg]", digits=3),
    }
    if rows:
        masses = [interval_text(row.mass) for row in rows]
        columns["mass_interval"] = Column(masses, "95% interval")
    for k, (key, title) in enumerate(zip("xyz", ("centre x [mm]", "y", "z"), strict=True)):
        cells = [millimetres(x) for x in centres[:, k]]
        columns[f"{key}_m"] = Column(centres[:, k], title, cells=cells)
        intervals = [interval_text(row.center_of_mass[k], 1e3, 2) for row in rows]
        columns |= _interval(f"{key}_interval", intervals)
    for k, title in enumerate(("I1 [kg m²]", "I2", "I3")):
        columns[f"i{k + 1}_kg_m2"] = Column(moments[:, k], title, cells=[own[k] for own in texts])
        columns |= _interval(
            f"i{k + 1}_interval", [interval_text(r.moments[k], 1, 2) for r in rows]
        )
    for a, b in ("xx", "xy", "xz", "yy", "yz", "zz"):
        values = np.array([body.inertia["xyz".index(a), "xyz".index(b)] for body in bodies])
        columns[f"i{a}{b}_kg_m2"] = Column(values, shown="files")
    meanings = {
        "x_m": "centre of mass",
        "i1_kg_m2": "principal moment about the centre of mass",
        "ixx_kg_m2": "inertia about the centre of mass, along the axes of the link's frame",
    }
    return Table("links", columns, meanings, "Links")


def _interval(name: str, texts: Sequence[str]) -> dict[str, Column]:
    """Intervals for which there is room on pages; nothing without any."""
    return {name: Column(texts, "95 % interval", shown="pages")} if texts else {}


def moments_text(moments: np.ndarray) -> list[str]:
    """Principal moments with as many digits as make the printed ones those of a body.

    Rounding may not make the largest exceed the sum of the two others, as that of 0.1234, 1.004,
    1.127 to three digits would. Moments that no body has are written to three digits.
    """
    values = sorted(float(m) for m in moments)
    digits = LEAST_DIGITS
    if values[0] > 0.0 and values[2] < values[0] + values[1]:
        while digits < MOST_DIGITS and not _belong_to_a_body(moments, digits):
            digits += 1
    return [format_significant(m, digits) for m in moments]


def _belong_to_a_body(moments: np.ndarray, digits: int) -> bool:
    """Whether moments as printed are positive and satisfy the triangle inequality, exactly."""
    a, b, c = sorted(Decimal(format_significant(m, digits)) for m in moments)
    return a > 0 and c <= a + b


def millimetres(metres: float) -> str:
    """A length in millimetres, to a tenth."""
    return f"{round(1e3 * metres, 1) + 0.0:.1f}"


def interval_text(quantity: Quantity, factor: float = 1.0, digits: int = 3) -> str:
    """An interval with its value times ``factor``, as text."""
    return ends_text(factor * quantity.low, factor * quantity.high, digits)


def ends_text(low: float, high: float, digits: int = 3) -> str:
    """``0.02 to 15.5``; ``open`` where nothing bounds an end, ``not found`` where it is unknown."""
    ends = [_end_text(end, digits) for end in (low, high)]
    if ends[0] == ends[1] and ends[0] in (OPEN, NOT_FOUND):
        return ends[0]
    return " to ".join(ends)


def _end_text(end: float, digits: int) -> str:
    """A number, ``open`` or ``not found``."""
    if math.isnan(end):
        return NOT_FOUND
    return OPEN if math.isinf(end) else format_significant(end, digits)


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
    requirements.append(Requirement("nonnegative", 1, np.eye(1, size + 1, size), np.zeros(1)))
    requirements.append(Requirement("zero", 1, rows[3:], -np.ones(1)))
    box = np.r_[rows[:3], -rows[:3]] / reach
    requirements.append(Requirement("nonnegative", 6, -box, np.ones(6)))
    low, high = np.empty((2, 3))
    for axis in range(3):
        scale = float(np.abs(rows[axis]).max()) or 1.0
        for ends, sign in ((low, 1.0), (high, -1.0)):
            solved = lowest(sign * rows[axis] / scale, requirements)
            end = rows[axis] @ solved.u if solved.found else np.nan
            is_open = solved.unbounded or abs(end) > 0.99 * reach
            ends[axis] = -sign * np.inf if is_open else end
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
