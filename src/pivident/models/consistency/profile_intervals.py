"""Intervals of parameters over the consistent sets that the record allows.

The interval of a parameter a runs from the smallest to the largest aᵀφ over

    {φ consistent,  d²(φ) ≤ d*² + χ²₁(level)} :

a profile likelihood, two semidefinite programs with one second-order cone each. The interval of a
base parameter is that of the estimate, restricted to physically possible values. That of a standard
parameter which the torques do not identify by itself is the range allowed by torques and
consistency, or unbounded.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pivident.foundation.distributions import chi_square
from pivident.foundation.document.table import Column, Table
from pivident.foundation.errors import IdentificationError, UnknownName, require_known
from pivident.foundation.text.display import Displayed
from pivident.models.consistency.cone_program import Requirement, Solved, solve_cone_program
from pivident.models.consistency.constraints import Constraint
from pivident.models.consistency.nearest_consistent import StandardSpace, imposed, within_distance

#: Undetermined parameters are searched up to this many times the size of the reference. An end that
#: grows with that limit (with the limit itself or its root, 1 or ½ of the end) is unbounded.
SEARCHED, GROWS = 1e3, 0.1

#: Accuracy of the ends of the intervals, relative to their scale, and a fallback.
GAP, POOR_GAP = 1e-6, 1e-3


#: What the ends of intervals mean.
ENDS = {
    "low": "lower end, -∞ where nothing bounds it, NaN where the solver found none",
    "high": "upper end, likewise",
}


@dataclass(frozen=True, eq=False)
class ProfileIntervals(Displayed):
    """Intervals of several quantities."""

    names: tuple[str, ...]  # of the quantities
    units: tuple[str, ...]  # their units
    values: np.ndarray  # at the consistent point, shape (quantities,)
    # lower ends, shape (quantities,); -∞ if unbounded, NaN if the solver found no end
    low: np.ndarray
    high: np.ndarray  # upper ends, likewise
    level: float  # of the intervals, 0 to 1

    def of(self, name: str) -> tuple[float, float]:
        """Interval of one quantity."""
        require_known(name, self.names, f"no quantity {name!r}", UnknownName)
        k = self.names.index(name)
        return float(self.low[k]), float(self.high[k])

    @property
    def unbounded(self) -> tuple[str, ...]:
        """Quantities that neither torques nor consistency bound on both sides."""
        open_ended = np.isinf(self.low) | np.isinf(self.high)
        return tuple(n for n, o in zip(self.names, open_ended, strict=True) if o)

    @property
    def not_found(self) -> tuple[str, ...]:
        """Quantities with an end that the solver did not find."""
        missing = np.isnan(self.low) | np.isnan(self.high)
        return tuple(n for n, o in zip(self.names, missing, strict=True) if o)

    def table(self) -> Table:
        """One row for each quantity."""
        ends = {"value": self.values, "low": self.low, "high": self.high}
        columns = {
            "quantity": Column(self.names, "parameter"),
            **{key: Column(x, cells=[f"{v:.4g}" for v in x]) for key, x in ends.items()},
            "unit": Column(self.units),
            "confidence": Column(np.full(len(self.names), self.level), shown="files"),
        }
        return Table("intervals", columns, ENDS)

    def __str__(self) -> str:
        text = self.table().text()
        if self.unbounded:
            text += f"\nNothing bounds {', '.join(self.unbounded)} on both sides."
        if self.not_found:
            text += f"\n{not_found_sentence(self.not_found)}"
        return text


def not_found_sentence(names: Sequence[str]) -> str:
    """A warning about ends that the solver did not find."""
    return (
        f"The solver found no end of the interval of {', '.join(names)}, so their uncertainty is "
        "unknown; bounds on masses or fewer parameters make the search easier."
    )


def profile_intervals(
    space: StandardSpace,
    constraints: Sequence[Constraint],
    least_distance: float,
    directions: np.ndarray,
    level: float,
) -> tuple[np.ndarray, np.ndarray]:
    """Smallest and largest aᵀφ for each row a of ``directions``.

    Infinite where nothing bounds them, NaN where the solver finds none.
    """
    undetermined = np.arange(space.distances, space.slope.shape[1])
    requirements = [*imposed(space, constraints), allowed(space, least_distance, level)]
    if undetermined.size:
        rows = np.eye(undetermined.size + 1, undetermined.size, -1)
        searched = np.r_[SEARCHED, np.zeros(undetermined.size)]
        requirements.append(
            Requirement("second_order", rows.shape[0], rows, searched, undetermined)
        )
    low, high = np.empty((2, len(directions)))
    for k, direction in enumerate(directions):
        slope = direction @ space.slope
        scale = float(np.abs(slope).max()) or 1.0
        for ends, sign in ((low, 1.0), (high, -1.0)):
            solved = lowest(sign * slope / scale, requirements)
            if not solved.found:
                ends[k] = -sign * np.inf if solved.unbounded else np.nan
                continue
            end = direction @ space.start + slope @ solved.u
            ends[k] = 0.0 if abs(end) < GAP * scale else end
            limited = SEARCHED * solved.multipliers[-1][0] if undetermined.size else 0.0
            if limited > GROWS * max(abs(solved.value), 1.0):
                ends[k] = -sign * np.inf
    return low, high


def allowed(space: StandardSpace, least_distance: float, level: float) -> Requirement:
    """The condition d² ≤ d*² + χ²₁(level)."""
    if not 0.0 < level < 1.0:
        raise IdentificationError(
            f"level lies between 0 and 1, not {level}", advice="0.95 is usual"
        )
    return within_distance(space, float(np.sqrt(least_distance**2 + chi_square.ppf(level, 1))))


def lowest(slope: np.ndarray, requirements: Sequence[Requirement]) -> Solved:
    """Minimum of slope · u, slope of the order of 1, to ``GAP`` or failing that ``POOR_GAP``."""
    for gap in (GAP, POOR_GAP):
        solved = solve_cone_program(np.zeros(slope.size), slope, requirements, gap)
        if solved.found or solved.unbounded:
            break
    return solved
