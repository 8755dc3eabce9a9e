"""Results side by side: their parameters, and which differences from the first are marked."""

from __future__ import annotations

import math
from dataclasses import dataclass

from pivident.comparison.cross_torque import CrossTorque
from pivident.comparison.differences import Difference, Estimate
from pivident.comparison.entry import Entry
from pivident.comparison.friction_curves import JointFriction
from pivident.text.display import Displayed


@dataclass(frozen=True)
class ComparedParameter:
    """One quantity in all results.

    Attributes:
        name: base parameter, as the first result that estimates it calls it.
        unit: its unit.
        expression: its group written out.
        estimates: what each result says about it, None where it says nothing.
        differences: of each result from the first, None for the first itself and where one of both
            says nothing.
    """

    name: str
    unit: str
    expression: str
    estimates: tuple[Estimate | None, ...]
    differences: tuple[Difference | None, ...]

    @property
    def shared(self) -> bool:
        """Whether all results have it."""
        return all(estimate is not None for estimate in self.estimates)


@dataclass(frozen=True, eq=False)
class ComparedResults(Displayed):
    """Several results side by side, with the fields of `Comparison`."""

    entries: tuple[Entry, ...]
    parameters: tuple[ComparedParameter, ...]
    level: float
    same_record: tuple[bool, ...]
    one_machine: bool
    torques: tuple[CrossTorque, ...]
    friction: tuple[JointFriction, ...]
    notes: tuple[str, ...]

    @property
    def labels(self) -> tuple[str, ...]:
        """Names of the results."""
        return tuple(entry.label for entry in self.entries)

    @property
    def tests(self) -> int:
        """Number of differences that were tested."""
        return sum(
            d is not None and not math.isnan(d.p_value)
            for p in self.parameters
            for d in p.differences
        )

    def is_marked(self, found: Difference | None) -> bool:
        """Whether a difference is significant at the level, among all that were tested."""
        return found is not None and found.p_adjusted <= self.level

    def marked(self, entry: int) -> tuple[str, ...]:
        """Names of the parameters of a result that differ significantly from the first's."""
        return tuple(p.name for p in self.parameters if self.is_marked(p.differences[entry]))

    def __repr__(self) -> str:
        return (
            f"<Comparison of {', '.join(self.labels)}: {len(self.parameters)} parameters, "
            f"{sum(len(self.marked(k)) for k in range(len(self.entries)))} significant differences>"
        )
