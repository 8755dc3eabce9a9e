"""A log whose columns are described, or known by name alone, ready to be judged.

    channels as logged → one clock → (factor, side) → channels in SI on the joint side

What an audit judges is what an identification would get: channels as they are where they have one
clock, and otherwise resampled onto one, with a sentence that says so.

Nothing is refused where channels have clocks of their own: samples that are NaN are left out, gaps
are cut around, and the notes say so.

Logs of which nothing is known but the names of their columns, or the types of their messages.
"""

from __future__ import annotations

from collections.abc import Container, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Unpack

import numpy as np

from pivident.data.logs.bags.read_bag import is_bag, open_bag
from pivident.data.logs.clock_alignment import ClockedChannel, have_one_clock, onto_one_clock
from pivident.data.logs.file_columns import beside_text, lenient_table, numeric_columns
from pivident.data.logs.log import (
    CHANNELS,
    Description,
    Log,
    factors_of,
    gains_of,
    on_joint_side,
    sides_of,
)
from pivident.data.logs.read_log import Reading, file_paths, read_log, without_bad_samples
from pivident.data.logs.recognition.log_clock import clocks_in, is_clock, names_time
from pivident.data.logs.recognition.log_file import (
    ChannelColumns,
    JointMap,
    Run,
    joint_map,
    read_log_file,
)
from pivident.data.logs.recognition.position_units import counts_in, unit_spec
from pivident.data.logs.source_files import SourceFile
from pivident.data.logs.tables.tables import names_in, without_header
from pivident.data.logs.torque_scale import torque_scales
from pivident.data.logs.units import UNITS_OF
from pivident.foundation.errors import FileFormatError, GapInClock, RecordingError, concerning
from pivident.foundation.text.identifiers import escaped
from pivident.robot.description import Robot

#: What a bare log is taken for.
TAKEN = (
    "Columns were recognised by {source} ({taken}) and taken for rad, N m and the joint side where "
    "their names say no unit; an experiment file gives both with certainty."
)


def described_log(
    files: str | Path | Mapping[str, str | Path],
    columns: Mapping[str, Any],
    *,
    torque_timing: str | None = None,
    control_rate: float | None = None,
    delay: float | None = None,
    **description: Unpack[Reading],
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
        log = _with_clocks(log, {k: p for k, p in file_paths(files).items() if isinstance(p, Path)})
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
        # a last row that breaks off may still have its stamp
        stamps |= {n: log.rows_kept(v)[: log.samples] for n, v in found.items() if is_clock(n, v)}
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
    part: Sequence[float] | None = None
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


def bare_log(path: str | Path, robot: Robot | None = None, column_names: Sequence[str] = ()) -> Log:
    """A log of which nothing is known but its columns' names.

    Args:
        path: .csv, .txt, .tsv (also gzipped), .npz, .mat, .parquet, or a bag.
        robot: the robot, where it is known.
        column_names: of a table without a header, in their order.

    Returns:
        The log, judged by nobody yet.

    Raises:
        FileFormatError: the file cannot be read at all, or a bag has no topic with positions and
            torques of these joints.
    """
    file = read_log_file(Path(path), robot.joint_names if robot else (), column_names)
    if refused := without_header({file.shown: list(file.columns)}):
        raise refused
    run = Run((file,))
    found = joint_map(run, file.joint_names)
    if is_bag(file.path):
        return _bag_log(run, found, robot)
    stamps = {n: v for n, v in file.columns.items() if is_clock(n, v)}
    joints = _joints(found, robot)
    doubtful = {kind for kind, own in found.channels.items() if own.contested}
    if doubtful & {"q", "tau"}:
        joints = []
    names = _columns(found, joints, doubtful)
    logged = {k: np.column_stack([file.columns[n] for n in own]) for k, own in names.items()}
    clock = dict(list(stamps.items())[:1])
    clean = without_bad_samples(Log(file.shown, tuple(joints), clock, {}, logged=logged))
    kept = {n: clean.rows_kept(v) for n, v in file.columns.items()} | clean.columns
    clocks, unit, notes = clocks_in({n: kept[n] for n in stamps}, None)
    if logged:
        taken = "; ".join(f"{kind} = {', '.join(own)}" for kind, own in names.items())
        notes.append(TAKEN.format(source="their names", taken=taken))
    if file.beside:
        notes.append(f"{file.shown} holds more than its columns{beside_text(file.beside)}.")
    claimed = {n for own in names.values() for n in own}
    units = {kind: _units(found.channels[kind], joints) for kind in names}
    log = replace(
        clean,
        columns={n: v for n, v in kept.items() if n not in claimed},
        clocks=clocks,
        robot=robot,
        sources=(SourceFile.of(file.path),),
        notes=tuple(notes),
        clock_unit=unit,
        description=Description(units),
    )
    channels, commands = in_si(log)
    return replace(log, channels=channels, commands=commands)


def _units(channel: ChannelColumns, joints: Sequence[str]) -> list[Any]:
    """Unit of each joint's column, None where its name says none; a current is in amperes."""
    known = UNITS_OF[channel.name]
    other = "A" if channel.is_current else None
    units = [channel.units.get(joint, other) for joint in joints]
    return [unit_spec(u) if u and counts_in(u) else u if u in known else other for u in units]


def _joints(found: JointMap, robot: Robot | None) -> list[str]:
    """The robot's joints, or those that the log has; none where a position is missing."""
    own = {kind: list(channel.columns) for kind, channel in found.channels.items()}
    if robot:
        return list(robot.joint_names) if set(robot.joint_names) <= set(own.get("q", ())) else []
    return [j for j in own.get("q", ()) if j in own.get("tau", ())] or own.get("q", [])


def _columns(found: JointMap, joints: list[str], without: Container[str]) -> dict[str, list[str]]:
    """The columns of the channels that all joints have."""
    return {
        kind: [own.columns[joint] for joint in joints]
        for kind, own in found.channels.items()
        if joints and set(joints) <= set(own.columns) and kind not in without
    }


def _bag_log(run: Run, found: JointMap, robot: Robot | None) -> Log:
    """The arm of a bag, found by the types of its messages."""
    (file,) = run.files
    # Another topic's reference would bring all channels to one clock, perhaps a slower one.
    later = {k for k, own in found.channels.items() if k not in ("q", "tau") and own.own_clock(run)}
    joints = _joints(found, robot)
    columns = _columns(found, joints, later)
    if not {"q", "tau"} <= set(columns):
        wanted = f" for {', '.join(robot.joint_names[:6])}" if robot else ""
        topics = escaped(", ".join(open_bag(file.path).names()[:6]))
        raise FileFormatError(
            f"{file.shown} has no topic with positions and torques{wanted}",
            advice=f"it has {topics} …; name them in an experiment file",
        )
    log = described_log(file.path, columns, robot=robot, joint_names=joints)
    taken = "; ".join(f"{kind} = {own[0]} …" for kind, own in columns.items())
    notes = [TAKEN.format(source="the types of the messages", taken=escaped(taken))]
    if file.aside:
        notes.insert(0, f"Other topics with positions: {escaped(', '.join(file.aside[:5]))}.")
    return replace(log, notes=(*notes, *log.notes))
