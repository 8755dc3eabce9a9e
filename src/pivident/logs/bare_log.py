"""Logs of which nothing is known but the names of their columns, or the types of their messages."""

from __future__ import annotations

from collections.abc import Container, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from pivident.errors import FileFormatError
from pivident.logs.bags.read_bag import is_bag, open_bag
from pivident.logs.described_log import described_log, in_si
from pivident.logs.file_columns import beside_text
from pivident.logs.log import Description, Log
from pivident.logs.read_log import without_bad_samples
from pivident.logs.recognition.joint_columns import ChannelColumns, JointMap, joint_map
from pivident.logs.recognition.log_file import Run, read_log_file
from pivident.logs.recognition.time_columns import clocks_in, is_clock
from pivident.logs.source_files import SourceFile
from pivident.logs.tables.column_names import header_advice
from pivident.logs.units import UNITS_OF
from pivident.robot.description import Robot
from pivident.text.printable import escaped

#: What a bare log is taken for.
TAKEN = (
    "Columns were recognised by {source} ({taken}) and taken for rad, N m and the joint side where "
    "their names say no unit; an experiment file gives both with certainty."
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
    if advice := header_advice({file.shown: list(file.columns)}):
        raise FileFormatError(advice)
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


def _units(channel: ChannelColumns, joints: Sequence[str]) -> list[str | None]:
    """Unit of each joint's column, None where its name says none; a current is in amperes."""
    known = UNITS_OF[channel.name]
    other = "A" if channel.is_current else None
    units = [channel.units.get(joint, other) for joint in joints]
    return [unit if unit in known else other for unit in units]


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
        listed = escaped(", ".join(file.aside[:5]))
        notes.insert(0, f"Other topics with positions: {listed}.")
    return replace(log, notes=(*notes, *log.notes))
