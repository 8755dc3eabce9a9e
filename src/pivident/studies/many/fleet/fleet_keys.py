"""Keys of the table ``[fleet]`` beside those of an experiment file, their types and defaults.

This module needs pydantic and is imported only when a file is read.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field, PositiveInt, model_validator

from pivident.estimation.methods import METHODS
from pivident.experiment.file_keys import ExperimentFile
from pivident.experiment.table_values import Names, Paths
from pivident.foundation.errors import UnusableValue
from pivident.robot.mdh_keys import Entry
from pivident.robot.naming import nearest


class FleetEntry(Entry):
    """Pattern of the logs, watched parameters, and probability of a false alarm."""

    pattern: Paths | None = None
    together: Names | None = None
    time: str | None = None
    method: str | None = None
    watch: Names = Field(["friction"])
    temperature: str | list[str] | None = None
    baseline: Literal["robot", "fleet"] = "robot"
    baseline_records: PositiveInt = 3
    level: Annotated[float, Field(gt=0, lt=1)] = 0.05
    planned_records: PositiveInt | None = None

    @model_validator(mode="after")
    def _consistent(self) -> FleetEntry:
        if self.method is not None and self.method not in METHODS:
            raise UnusableValue(
                f"there is no method {self.method!r}", advice=nearest(self.method, METHODS)
            )
        if self.baseline == "robot" and self.baseline_records < 2:
            raise UnusableValue(
                "baseline_records = 1 does not give the scatter between records",
                advice='use 2 or more, or baseline = "fleet" to compare each robot with the others',
            )
        return self


class FleetFile(ExperimentFile):
    """An experiment file as template for every log of a fleet."""

    fleet: FleetEntry = Field(default_factory=lambda: FleetEntry.model_validate({}))

    @model_validator(mode="after")
    def _one_template(self) -> FleetFile:
        if len(self.recording) != 1:
            raise ValueError(
                f"recording: a fleet has one table [recording] for all logs, not "
                f"{len(self.recording)}"
            )
        if self.recording[0].dataset is not None:
            raise UnusableValue(
                "recording.dataset names one public record",
                advice="a fleet reads the files of a folder",
            )
        if self.fleet.pattern not in (None, self.recording[0].files):
            raise UnusableValue(
                "fleet.pattern and recording.files are both given and differ",
                advice="keep one of them",
            )
        if self.gains.recording or self.validation.recording:
            raise UnusableValue(
                "recordings of [gains] and [validation] belong to one robot",
                advice="remove them here",
            )
        return self


def as_template(content: dict[str, Any]) -> dict[str, Any]:
    """Tables of a file with a pattern of files, if ``[recording]`` names none."""
    recording, fleet = content.get("recording"), content.get("fleet")
    pattern = fleet.get("pattern") if isinstance(fleet, dict) else None
    if not isinstance(recording, list) or not recording or not isinstance(recording[0], dict):
        return content
    if "files" in recording[0] or "dataset" in recording[0]:
        return content
    first = recording[0] | {"files": pattern if pattern is not None else EVERY_LOG}
    return content | {"recording": [first, *recording[1:]]}


#: Stands for all logs, robots by folder.
EVERY_LOG = "*"
