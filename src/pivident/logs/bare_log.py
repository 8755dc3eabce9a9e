"""Logs of which nothing is known but the names of their columns, or the types of their messages."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from pivident.errors import FileFormatError
from pivident.logs.bags.bag_channels import joint_fields
from pivident.logs.bags.joint_topics import TopicTable
from pivident.logs.bags.read_bag import Bag, is_bag, open_bag
from pivident.logs.described_log import described_log
from pivident.logs.file_columns import read_columns
from pivident.logs.log import Log
from pivident.logs.recognition.column_names import recognise_columns
from pivident.logs.recognition.time_columns import clocks_in, is_clock
from pivident.logs.source_files import SourceFile, printable_name
from pivident.robot.description import Robot
from pivident.text.printable import escaped

#: What a bare log is taken for.
TAKEN = (
    "Columns were recognised by {source} ({taken}) and taken for rad, N m and the joint side; an "
    "experiment file gives both with certainty."
)


def bare_log(path: str | Path, robot: Robot | None = None) -> Log:
    """A log of which nothing is known but its columns' names.

    Args:
        path: .csv, .txt, .tsv (also gzipped), .npz, .mat, .parquet, or a bag.
        robot: the robot, where it is known.

    Returns:
        The log, judged by nobody yet.

    Raises:
        FileFormatError: the file cannot be read at all, or a bag has no topic with positions and
            torques of these joints.
    """
    path = Path(path)
    if is_bag(path):
        return _bag_log(path, robot)
    columns = read_columns(path)
    clocks, unit, notes = clocks_in({n: v for n, v in columns.items() if is_clock(n, v)}, None)
    names, joints = recognise_columns(
        [n for n in columns if n not in clocks], robot.joint_names if robot else ()
    )
    logged = {kind: np.column_stack([columns[n] for n in own]) for kind, own in names.items()}
    if logged:
        taken = "; ".join(f"{kind} = {', '.join(own)}" for kind, own in names.items())
        notes.append(TAKEN.format(source="their names", taken=taken))
    claimed = {n for own in names.values() for n in own}
    return Log(
        printable_name(path),
        tuple(joints),
        {n: v for n, v in columns.items() if n not in claimed},
        clocks,
        logged=logged,
        channels={kind: np.array(values) for kind, values in logged.items()},
        robot=robot,
        sources=(SourceFile.of(path),),
        notes=tuple(notes),
        clock_unit=unit,
    )


def _bag_log(path: Path, robot: Robot | None) -> Log:
    """The arm of a bag, found by the types of its messages."""
    fields, joints, notes = _arm(open_bag(path), path, robot)
    columns = {
        kind: [own[joint] for joint in joints]
        for kind, own in fields.items()
        if set(joints) <= set(own)
    }
    log = described_log(path, columns, robot=robot, joint_names=joints)
    taken = "; ".join(f"{kind} = {fields[kind][joints[0]]} …" for kind in columns)
    notes.append(TAKEN.format(source="the types of the messages", taken=escaped(taken)))
    return replace(log, notes=(*notes, *log.notes))


def _arm(
    bag: Bag, path: Path, robot: Robot | None
) -> tuple[dict[str, dict[str, str]], list[str], list[str]]:
    """Columns by channel and joint from the fullest topic, the joints, and what was left aside."""
    tables = list(bag.topics.values())
    held = {table.name: joint_fields(table) for table in tables}

    def joints_of(fields: dict[str, dict[str, str]]) -> list[str]:
        both = [j for j in fields.get("q", {}) if j in fields.get("tau", {})]
        return [j for j in robot.joint_names if j in both] if robot else both

    best = max(tables, key=lambda table: len(joints_of(held[table.name])))
    fields, joints = held[best.name], joints_of(held[best.name])
    if not joints:
        fields = _together(held, tables)
        joints = joints_of(fields)
    if not joints or (robot and len(joints) < robot.size):
        names = ", ".join(bag.names()[:6])
        wanted = f" for {', '.join(robot.joint_names[:6])}" if robot else ""
        raise FileFormatError(
            f"{printable_name(path)} has no topic with positions and torques{wanted}; it has "
            f"{escaped(names)} …; name them in an experiment file"
        )
    others = [t.name for t in tables if t is not best and held[t.name].get("q")]
    notes = [f"Other topics with positions: {escaped(', '.join(others[:5]))}."] if others else []
    return fields, joints, notes


def _together(
    held: Mapping[str, dict[str, dict[str, str]]], tables: Sequence[TopicTable]
) -> dict[str, dict[str, str]]:
    """Each channel from the first topic that has it."""
    found: dict[str, dict[str, str]] = {}
    for table in tables:
        for kind, own in held[table.name].items():
            found.setdefault(kind, own)
    return found
