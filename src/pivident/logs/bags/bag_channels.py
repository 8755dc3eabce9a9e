"""Channels from the topics of a bag: short names in full, and the stamps of their messages.

"/joint_states/position"            all joints, in the order of the robot
"position"                          the same, where only one topic has such a field
["position/shoulder", "/joint_states/position/elbow"]       joint by joint
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from pivident.errors import RecordingError, UnknownColumn
from pivident.logs.bags.joint_topics import TopicTable
from pivident.logs.bags.read_bag import RECEIVED, STAMP, Bag
from pivident.logs.clocks.clock_alignment import ClockedChannel, in_order, onto_sparsest
from pivident.robot.naming import near_names


def bag_channel(
    bag: Bag,
    path: Path,
    channel: str,
    columns: Sequence[str],
    per_joint: bool,
    joint_names: Sequence[str] = (),
    clock: str | None = None,
) -> ClockedChannel:
    """One channel with the stamps of its messages."""
    names = full_names(bag, path, columns, per_joint, joint_names)
    tables = [bag.topic_of(name) for name in names]
    rows = [
        table.rows_of(name[len(table.name) + 1 :])
        for table, name in zip(tables, names, strict=True)
    ]
    together = all(table is tables[0] for table in tables) and all(
        len(own) == len(rows[0]) and np.array_equal(own, rows[0]) for own in rows
    )
    if together:
        values = np.column_stack([bag.column(name) for name in names])
        return in_order(_clocked(bag, tables[0], channel, rows[0], values[rows[0]], clock))
    single = [
        in_order(_clocked(bag, table, channel, own, bag.column(name)[own, np.newaxis], clock))
        for name, table, own in zip(names, tables, rows, strict=True)
    ]
    return onto_sparsest(single)


def full_names(
    bag: Bag, path: Path, columns: Sequence[str], per_joint: bool, joint_names: Sequence[str] = ()
) -> tuple[str, ...]:
    """Names of a channel's columns in full; see `bag_channel` for arguments and errors."""
    known = bag.names()
    if per_joint or columns[0] in known:
        return tuple(_one_name(path, column, known) for column in columns)
    families = dict.fromkeys(name.rpartition("/")[0] for name in known)
    field = _one_name(path, columns[0], tuple(families), known)
    members = [name for name in known if name.rpartition("/")[0] == field]
    members = [name for name in members if name.rpartition("/")[2] not in (STAMP, RECEIVED)]
    if not joint_names:
        return tuple(members)
    wanted = [f"{field}/{joint}" for joint in joint_names]
    if set(wanted) <= set(members):
        return tuple(wanted)
    labels = [name.rpartition("/")[2] for name in members]
    if len(members) == len(joint_names) and labels == [str(k) for k in range(len(labels))]:
        return tuple(members)
    missing = [joint for joint in joint_names if f"{field}/{joint}" not in members]
    raise RecordingError(
        f"{path.name}: {field} holds no joint {', '.join(missing[:3])}",
        advice=f"its joints are {', '.join(labels[:12])}; name one column for each joint of the "
        "robot, in its order",
    )


def _one_name(
    path: Path, short: str, known: Sequence[str], shown: Sequence[str] | None = None
) -> str:
    """The one name that is, or ends with, a short name."""
    if short in known:
        return short
    fits = [name for name in known if name.endswith("/" + short.lstrip("/"))]
    if not fits:
        near = near_names(short, known, likeness=0.5)  # a topic has its robot before it
        raise UnknownColumn(path.name, short, near, shown or known)
    if len(fits) > 1:
        raise RecordingError(
            f"{path.name} has {len(fits)} topics with {short!r}",
            advice=f"write one of {', '.join(fits[:4])}",
        )
    return fits[0]


def _clocked(
    bag: Bag,
    table: TopicTable,
    channel: str,
    rows: np.ndarray,
    values: np.ndarray,
    clock: str | None,
) -> ClockedChannel:
    """Some messages of a topic with their stamps."""
    kind = STAMP if table.stamps is not None else RECEIVED
    notes: tuple[str, ...] = ()
    if clock is not None:
        kind = clock.rpartition("/")[2]
        if kind not in (STAMP, RECEIVED):
            raise RecordingError(
                f"t of a bag is {clock!r}",
                advice=f"leave it out for the stamps of the messages, or write {STAMP!r} or "
                f"{RECEIVED!r}",
            )
    elif kind == RECEIVED:
        notes = (
            f"{channel}: the messages of {table.name} carry no stamps; the times at which they "
            "were received are taken, with the jitter of their transport.",
        )
    t = bag.times(table, kind)[rows]
    received = bag.times(table, RECEIVED)[rows]
    lead = float(np.median(t - received)) if len(t) else 0.0
    return ClockedChannel(channel, f"{table.name}/{kind}", t, values, lead, notes)
