"""Whether the torque of a log without one follows from the tables of an experiment file.

tau = drive_gain · C(q_ref - q): the law C with its gains under ``[controller]``, and q_ref

Channels that other tables name, of all recordings; torques behind the gears are read as inputs.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from pivident.data.recording.recording import Recording
from pivident.experiment.file_keys import (
    ControllerEntry,
    ExperimentFile,
    RecordingEntry,
)
from pivident.foundation.errors import ExperimentError
from pivident.loop.simulation.controllers import UNKNOWN_GAIN

#: What a known law has to state.
_LAW = (
    "give the law that was active under [controller]: type, gains (kp, kd …) and drive_gain, the "
    f'joint torque per unit of its output ("{UNKNOWN_GAIN}": parameters are ratios to it)'
)


def is_without_torque(content: ExperimentFile) -> bool:
    """Whether no run that is fitted has a column of its torque.

    Args:
        content: the tables.
    """
    return all(entry.is_without_torque for entry in content.recording)


def check_torque(content: ExperimentFile) -> None:
    """Refuse logs without torque where it does not follow from the control law.

    Args:
        content: the tables.

    Raises:
        ExperimentError: says what is missing and what to write.
    """
    law = content.controller
    if law is not None and law.drive_gain == UNKNOWN_GAIN:
        _check_ratios(content)
    several = len(content.recording) > 1
    for number, entry in enumerate(content.recording, start=1):
        if entry.is_without_torque:
            reason, advice, keys = _missing(law, entry)
            where = f" of [[recording]] {number}" if several else ""
            if reason:
                text = f"the columns{where} have no tau, and {reason}"
                raise ExperimentError(text, advice=advice).within(*keys)


def _missing(law: ControllerEntry | None, entry: RecordingEntry) -> tuple[str, str, Sequence[str]]:
    """What one run's torque cannot be computed without, what to write, and where."""
    columns, column_or_law = ("recording", "columns"), f"map the column of tau, or {_LAW}"
    if entry.torque_side == "link":
        reason = 'a control law commands the motors, not the sensors of torque_side = "link"'
        advice = "name the column of tau, or remove torque_side"
        return reason, advice, ("recording", "torque_side")
    if law is None:
        reason = "there is no control law that it would follow from"
        return reason, f"map the column of tau, or, where no torque was logged, {_LAW}", columns
    if law.type == "identify" or law.source == "reconstruct":
        found = "its law" if law.type == "identify" else "its reference"
        key = "type" if law.type == "identify" else "reference"
        return f"{found} cannot be found without a torque", column_or_law, ("controller", key)
    if law.type == "virtual_pd" or law.source == "smoothed":
        return "a virtual law commands nothing", column_or_law, ("controller", "type")
    if entry.columns is not None and entry.columns.q_ref is None:
        reason = "no q_ref that the control law would follow"
        return reason, "map the column of q_ref, or that of tau", columns
    for key in ("torque_timing", "delay"):
        if getattr(entry, key) is not None:
            reason = f"{key} would be that of its channel"
            return reason, f"remove {key}, or map the column of tau", ("recording", key)
    return "", "", columns


def _check_ratios(content: ExperimentFile) -> None:
    """Refuse an unknown drive gain beside torques that have units of their own."""
    everything = [*content.recording, *content.validation.recording]
    law = content.controller
    if law is not None and law.feed_forward != "none":
        raise ExperimentError(
            f'feed_forward = "{law.feed_forward}" is a torque in N m, beside an output whose '
            "drive_gain is not known",
            advice="give drive_gain",
        ).within("controller", "feed_forward")
    if all(entry.is_without_torque for entry in everything):
        return
    raise ExperimentError(
        f'drive_gain = "{UNKNOWN_GAIN}" is for logs without torque, but a recording has one',
        advice="give "
        'the joint torque per unit of the law\'s output, or identify the law: type = "identify"',
    ).within("controller", "drive_gain")


#: Input that carries the torques of sensors behind the gears while a log is read.
SENSORS = "torque behind the gear"


def with_temperature(entry: RecordingEntry, columns: Any) -> RecordingEntry:
    """The table of a recording with columns of temperatures, where it has none of its own."""
    own = entry.columns is not None and entry.columns.temperature
    return entry if own else with_columns(entry, temperature=columns)


def with_columns(entry: RecordingEntry, **columns: Any) -> RecordingEntry:
    """The table of a recording with the columns of further channels; None: as they are."""
    if entry.columns is None:
        return entry
    more = entry.columns.model_copy(update={k: x for k, x in columns.items() if x})
    return entry.model_copy(update={"columns": more})


def without_sensors(recording: Recording) -> Recording:
    """The recording with those inputs only that the controller knew."""
    kept = {name: values for name, values in recording.inputs.items() if name != SENSORS}
    return replace(recording, inputs=kept)
