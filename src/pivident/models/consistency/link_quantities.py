"""Links of a consistent model as bodies: their quantities with intervals, and these as text."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from decimal import Decimal

import numpy as np

from pivident.foundation.document.table import Column, Table, Values
from pivident.foundation.text.numbers import format_significant
from pivident.models.consistency.pseudo_inertia import LinkBody

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
    return ends[0] if ends[0] == ends[1] and ends[0] in (OPEN, NOT_FOUND) else " to ".join(ends)


def _end_text(end: float, digits: int) -> str:
    """A number, ``open`` or ``not found``."""
    if math.isnan(end):
        return NOT_FOUND
    return OPEN if math.isinf(end) else format_significant(end, digits)
