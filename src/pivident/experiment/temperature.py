"""Temperatures that a log carries beside its channels: read as an input, then kept apart."""

from __future__ import annotations

from dataclasses import replace

from pivident.data.recording.recording import Recording
from pivident.experiment.schema import ColumnsEntry, RecordingEntry

#: Input that carries the temperatures of the motors while a log is read.
TEMPERATURE = "motor temperature"


def with_temperature(
    entry: RecordingEntry, columns: str | list[str], joints: int
) -> RecordingEntry:
    """The table of a recording with the columns of the temperatures as one more input."""
    if entry.columns is None:
        return entry
    listed = [columns] * joints if isinstance(columns, str) else columns
    inputs = {**entry.columns.inputs, TEMPERATURE: listed}
    more = ColumnsEntry.model_validate(
        entry.columns.model_dump(exclude_unset=True) | {"inputs": inputs}
    )
    return entry.model_copy(update={"columns": more})


def without_temperature(recording: Recording) -> Recording:
    """The recording with those inputs only that the controller knew."""
    kept = {name: values for name, values in recording.inputs.items() if name != TEMPERATURE}
    return replace(recording, inputs=kept)
