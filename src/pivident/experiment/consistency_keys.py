"""Table ``[consistency]`` of an experiment file: what the links' bodies may be.

This module needs pydantic and is imported only when a file is read.
"""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from pivident.experiment.table_values import Ellipsoid, Masses, Range
from pivident.robot.mdh_schema import Entry


class LinkBoundsEntry(Entry):
    """What is known about the body of one link; see `pivident.consistency`."""

    mass: Masses | None = None
    center_of_mass: Annotated[list[Range], Field(min_length=3, max_length=3)] | None = None
    ellipsoid: Ellipsoid | None = None

    @model_validator(mode="after")
    def _bounds_something(self) -> LinkBoundsEntry:
        if not self.model_fields_set:
            raise ValueError(
                "bounds nothing; give mass, center_of_mass or ellipsoid, or remove the table"
            )
        return self


class ConsistencyEntry(Entry):
    """Which real bodies the links may be, and which of them are preferred."""

    prior: Literal["entropic", "euclidean", "none"] = "entropic"
    reference: Annotated[str, Field(min_length=1)] | None = None
    margin: Annotated[float, Field(gt=0, lt=1)] | None = None
    accept_far: bool = False
    total_mass: Masses | None = None
    bounds: dict[str, LinkBoundsEntry] = Field(default_factory=dict)


class ConsistencyFile(Entry):
    """A file with nothing but ``[consistency]``, for `pivident consistent`."""

    consistency: ConsistencyEntry
