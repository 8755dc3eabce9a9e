"""A log whose columns are described, ready to be judged: clocks in seconds, channels in SI.

    channels as logged → one clock → (factor, side) → channels in SI on the joint side

What an audit judges is what an identification would get: channels as they are where they have one
clock, and otherwise resampled onto one, with a sentence that says so.

Nothing is refused where channels have clocks of their own: samples that are NaN are left out, gaps
are cut around, and the notes say so.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from pivident.errors import GapInClock, RecordingError, concerning
from pivident.logs.bags.read_bag import is_bag
from pivident.logs.clocks.clock_alignment import ClockedChannel, have_one_clock, onto_one_clock
from pivident.logs.file_columns import lenient_table, numeric_columns
from pivident.logs.joint_side import factors_of, gains_of, on_joint_side, sides_of
from pivident.logs.log import CHANNELS, Log
from pivident.logs.read_log import file_paths, read_log
from pivident.logs.recognition.time_columns import clocks_in, is_clock, names_time
from pivident.logs.tables.tables import names_in
from pivident.logs.torque_scale import torque_scales


def described_log(
    files: str | Path | Mapping[str, str | Path],
    columns: Mapping[str, Any],
    *,
    torque_timing: str | None = None,
    control_rate: float | None = None,
    delay: float | None = None,
    **description: Any,
) -> Log:
    """A log whose columns are described as for `load_recording`.

    It is judged as it was logged also where `resample` is given: interpolation would blur limits
    and steps of encoders.

    Args:
        files: the log's file, or several by key.
        columns: columns of ``q``, ``dq``, ``tau``, the references and ``t``.
        torque_timing: as in a `Recording`.
        control_rate: as in a `Recording` [Hz].
        delay: as in a `Recording` [s].
        description: ``units``, ``side``, ``robot``, ``transmission``, ``joint_names``, ``rate``,
            ``resample``, ``samples_axis``, ``position_offset`` and ``name`` as for
            `load_recording`.

    Returns:
        The log, judged by nobody yet.

    Raises:
        FileFormatError: a file or a column cannot be read.
        RecordingError: columns or units that mean nothing.
    """
    known = {k: spec for k, spec in columns.items() if k in (*CHANNELS, "t") and spec is not None}
    log = read_log(files, known, **description)
    if log.own_clocks:
        with concerning("columns", "t"):
            logged, clocks, notes = on_one_clock(list(log.own_clocks.values()), log.rate)
        bad = log.bad if have_one_clock(list(log.own_clocks.values())) else ()
        log = replace(log, logged=logged, clocks=clocks, columns={}, notes=tuple(notes), bad=bad)
    else:
        log = _with_clocks(log, file_paths(files))
    rate = None if log.resample and log.clocks else log.rate  # it is not that of the stamps
    channels, commands = in_si(log)
    return replace(
        log,
        rate=rate,
        channels=channels,
        commands=commands,
        torque_timing=torque_timing or "held",
        control_rate=control_rate or 0.0,
        delay=delay or 0.0,
        torque_scale=torque_scales(log.description.units.get("tau"), log.joint_names),
    )


def _with_clocks(log: Log, paths: Mapping[str, Path]) -> Log:
    """The log with all time columns of its files in seconds, the declared one first."""
    stamps = dict(log.columns)
    for path in paths.values():
        if is_bag(path):
            continue
        names = [name for name in names_in(path) if names_time(name) and name not in stamps]
        found = numeric_columns(lenient_table(path, names)) if names else {}
        stamps |= {
            n: log.rows_kept(v) for n, v in found.items() if n not in stamps and is_clock(n, v)
        }
    with concerning("units", "t"):
        clocks, unit, notes = clocks_in(stamps, log.description.units.get("t"))
    size = next(iter(log.logged.values())).shape[1] if log.logged else 0
    joints = log.joint_names[: size or None]  # an array may have fewer columns than joints
    return replace(
        log,
        joint_names=joints,
        logged={kind: np.array(v[:, : len(joints)]) for kind, v in log.logged.items()},
        clocks=clocks,
        columns={},
        clock_unit=unit,
        notes=tuple(notes),
    )


def in_si(log: Log) -> tuple[dict[str, np.ndarray], tuple[int, ...]]:
    """Channels in SI on the joint side, and the joints whose command has no gain."""
    said = log.description
    sides = sides_of(said.side)
    without: tuple[int, ...] = ()
    channels = {}
    for channel, values in log.logged.items():
        joints = values.shape[1]
        spec = said.units.get(channel)
        listed = list(spec) if isinstance(spec, (list, tuple)) else [spec] * joints
        with concerning("units", channel):
            if len(listed) < joints:
                raise RecordingError(f"{channel} has {len(listed)} units for {joints} joint(s)")
            factors, commands = factors_of(channel, listed[:joints])
        values = values * factors
        if channel == "tau" and commands.any():
            gains, without = gains_of(commands, said.transmission)
            values = values * gains
        channels[channel] = on_joint_side(channel, values, sides, said)
    return channels, without


#: Channels on their clock: values by name, clocks by name [s], and what was done.
OnOneClock = tuple[dict[str, np.ndarray], dict[str, np.ndarray], list[str]]


def on_one_clock(channels: Sequence[ClockedChannel], rate: float | None) -> OnOneClock:
    """Channels as they are where they have one clock, else resampled; gaps are cut around."""
    if have_one_clock(channels):
        done = list(dict.fromkeys(note for c in channels for note in c.notes))
        return {c.channel: c.values for c in channels}, {channels[0].clock: channels[0].t}, done
    whole = [_without_holes(channel) for channel in channels]
    part: tuple[float, float] | None = None
    notes: list[str] = []
    for last in [False] * 8 + [True]:
        try:
            aligned = onto_one_clock(whole, rate, part)
            break
        except GapInClock as gap:
            if last:
                raise
            notes = [f"Only the longest stretch without gaps is used: {gap}."]
            part = gap.stretches.longest
    return aligned.values, {"common clock": aligned.t}, [*notes, *aligned.notes]


def _without_holes(channel: ClockedChannel) -> ClockedChannel:
    """A channel without the samples that are NaN, which no interpolation takes."""
    good = np.isfinite(channel.values).all(axis=1) & np.isfinite(channel.t)
    if good.all():
        return channel
    note = f"{channel.channel}: {int((~good).sum())} samples that are NaN were left out."
    return replace(
        channel, t=channel.t[good], values=channel.values[good], notes=(*channel.notes, note)
    )
