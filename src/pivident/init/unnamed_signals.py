"""Torques and references under names that say nothing, found by what the joints do.

A drive calls its command ``vir`` and its reference ``qg``. Where no column is named as a torque or
as a reference that the positions follow, these are looked for among the columns of unknown words,
as many as there are joints: a reference is followed by the positions, and a torque is explained by
the motion. Both are assumptions.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from pivident.init.torque_unit import Comparison
from pivident.logs.recognition.channel_words import words_of
from pivident.logs.recognition.joint_columns import ChannelColumns, JointMap
from pivident.logs.recognition.log_file import Run
from pivident.logs.recognition.position_units import following_unit
from pivident.logs.units import POSITION

#: Share of the motion by which positions may miss a reference.
MISSED = 0.3

#: Share of a torque that the motion must leave unexplained at most.
UNEXPLAINED = 0.2

#: Correlation with the positions from which on a column is no torque, but a copy or a command.
LIKE_POSITIONS = 0.9

#: Words of a constant that is the torque of one unit of a command.
GAIN_WORDS = set("gtau ktau kt gain gains".split())


def followed_columns(
    run: Run, joints: JointMap, names: Sequence[str], si: np.ndarray, turning: bool
) -> JointMap:
    """The channels with ``q_ref``: what positions ``si`` (samples, joints) follow best."""
    units = ("rad", "deg", "rev") if turning else ("m", "mm")
    best, smallest = None, MISSED
    for channel in _unnamed(run, joints, "q_ref"):
        values = channel.values(run, names)
        rows = np.isfinite(values).all(axis=1) & np.isfinite(si).all(axis=1)
        match = following_unit(values[rows], si[rows], units, POSITION) if rows.any() else None
        if match is not None and 0.0 < match[1] < smallest:
            best, smallest = channel, match[1]
    return joints if best is None else _with(joints, best)


def explained_columns(
    run: Run,
    joints: JointMap,
    names: Sequence[str],
    si: np.ndarray,
    compared: Callable[[np.ndarray], Comparison],
) -> tuple[JointMap, str]:
    """The channels with ``tau``: the series that the motion explains best, and what was seen.

    ``si``: positions, shape (samples, joints); ``compared``: holds torques of the same shape
    against the description. What looks like the positions is no torque, however well these
    explain it.
    """
    best, smallest = None, UNEXPLAINED
    for channel in _unnamed(run, joints, "tau"):
        values = channel.values(run, names)
        rows = np.isfinite(values).all(axis=1) & np.isfinite(si).all(axis=1)
        alike = [
            abs(np.corrcoef(x, y)[0, 1]) for x, y in zip(values[rows].T, si[rows].T, strict=True)
        ]
        if not rows.any() or np.median(alike) > LIKE_POSITIONS:
            continue
        errors = compared(values).errors
        worst = 1.0 if errors is None else float(np.max(errors))
        if worst < smallest:
            best, smallest = channel, worst
    if best is None:
        return joints, ""
    seen = "no name says torque; the motion of the joints explains these columns up to "
    seen += f"{100 * smallest:.2g} %, as it does a torque, a current or a drive's command"
    return _with(joints, best), seen


def named_gain(run: Run, channel: ChannelColumns, size: int) -> tuple[str, np.ndarray] | None:
    """Name and values of a constant of the file that is the torque per unit of its command."""
    for name, values in run.files[channel.file].constants.items():
        if set(words_of(name)) & GAIN_WORDS and values.size in (1, size) and (values > 0).all():
            return name, np.broadcast_to(values.astype(float), size)
    return None


def _unnamed(run: Run, joints: JointMap, name: str) -> Iterator[ChannelColumns]:
    """Series without a known quantity, one column for each joint that has a position."""
    q = joints.channels["q"]
    taken = {c for channel in joints.channels.values() for c in channel.columns.values()}
    for number, file in enumerate(run.files):
        for series in file.series:
            columns = list(series.columns.values())
            same = len(columns) == len(q.columns) and file.samples == run.files[q.file].samples
            known = series.channel is not None or series.reading.foreign or taken & set(columns)
            if same and not known and all(np.nanstd(file.columns[c]) > 0.0 for c in columns):
                ordered = sorted(series.columns, key=lambda k: int(k) if k.isdecimal() else 0)
                pairs = zip(q.columns, (series.columns[k] for k in ordered), strict=True)
                yield ChannelColumns(name, number, dict(pairs), {}, False)


def _with(joints: JointMap, channel: ChannelColumns) -> JointMap:
    return replace(joints, channels=joints.channels | {channel.name: channel})
