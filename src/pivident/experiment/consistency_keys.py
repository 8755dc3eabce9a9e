"""Table ``[consistency]`` of an experiment file: what the links' bodies may be.

This module needs pydantic and is imported only when a file is read.
"""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from pivident.experiment.table_values import Ellipsoid, Masses, Range
from pivident.foundation.errors import UnusableValue
from pivident.robot.mdh_keys import Entry, key


class LinkBoundsEntry(Entry):
    """What is known about the body of one link; see `pivident.models.consistency`."""

    mass: Masses | None = key(None, "lowest and highest mass", unit="kg", kind="2 numbers")
    center_of_mass: Annotated[list[Range], Field(min_length=3, max_length=3)] | None = key(
        None,
        "box in the link's frame: `[[x_low, x_high], [y_low, y_high], [z_low, z_high]]`",
        unit="m",
        kind="3 × 2 numbers",
    )
    ellipsoid: Ellipsoid | None = key(
        None,
        "ellipsoid that holds the centre of mass, along the axes of the link's frame: `[[x, "
        "y, z], [a, b, c]]`, its centre and half axes",
        unit="m",
        kind="2 × 3 numbers",
    )

    @model_validator(mode="after")
    def _bounds_something(self) -> LinkBoundsEntry:
        if not self.model_fields_set:
            raise UnusableValue(
                "bounds nothing",
                advice="give mass, center_of_mass or ellipsoid, or remove the table",
            )
        return self


class ConsistencyEntry(Entry):
    """Which real bodies the links may be, and which of them are preferred."""

    prior: Literal["entropic", "euclidean", "none"] = key(
        "entropic",
        "which of the equally near sets of bodies is chosen: nearest to the nominal bodies "
        'by `"entropic"` or `"euclidean"` distance, or `"none"`: the one farthest from all '
        "constraints",
    )
    reference: Annotated[str, Field(min_length=1)] | None = key(
        None,
        "robot file (`.toml`, `.urdf`) with the nominal bodies, where the robot's own has "
        "none or worse ones",
        kind="path",
        shown="the robot's",
    )
    margin: Annotated[float, Field(gt=0, lt=1)] | None = key(
        None,
        "diameter of a steel ball: every link has at least its mass, and at least its second "
        "moments about the link's own centre of mass; a ball of a tenth of the nominal body "
        "at most",
        unit="m",
        shown="`0.01`",
    )
    accept_far: bool = key(
        False,
        "accept the nearest consistent parameters even where they explain the record much worse",
    )
    total_mass: Masses | None = key(
        None, "lowest and highest mass of all moving links together", unit="kg", kind="2 numbers"
    )
    bounds: dict[str, LinkBoundsEntry] = key(
        meaning="by name of the link, see *bounds*: `[consistency.bounds.link_3]`",
        factory=dict,
        kind="table of tables",
    )


class ConsistencyFile(Entry):
    """A file with nothing but ``[consistency]``, for `pivident consistent`."""

    consistency: ConsistencyEntry
