"""A bag as one table: the topic with the joints' positions, and channels of the other topics.

A controller publishes its reference in messages of its own, mostly slower than the joint states. To
see whether the positions follow it, it is taken at the instants of the positions.

Channels from the topics of a bag: short names in full, and the stamps of their messages.

"/joint_states/position"            all joints, in the order of the robot
"position"                          the same, where only one topic has such a field
["position/shoulder", "/joint_states/position/elbow"]       joint by joint
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from pivident.data.logs.bags.joint_topics import TopicTable
from pivident.data.logs.bags.read_bag import RECEIVED, STAMP, Bag, open_bag
from pivident.data.logs.clock_alignment import (
    ONE_CLOCK,
    ClockedChannel,
    at_instants,
    in_order,
    onto_sparsest,
)
from pivident.data.logs.recognition.channel_words import read_words, words_of
from pivident.data.logs.recognition.log_clock import Series, column_series
from pivident.foundation.errors import PividentError, RecordingError, UnknownColumn
from pivident.robot.naming import near_names

#: What is looked for in other topics, and what each stands for beside the positions.
KINDS = {
    "q": "q", "tau": "tau", "current": "tau", "dq": "dq", "q_ref": "q_ref", "dq_ref": "dq_ref",
}  # fmt: skip
#: Messages that come slower are not those of a control loop [Hz].
SLOWEST = 20.0
#: Share of the positions' instants that a topic has to cover.
COVERED = 0.5


@dataclass(frozen=True)
class OwnClock:
    """The clock of a column that was logged beside the positions."""

    column: str  # stamps of its messages
    rate: float  # of its messages [Hz]


@dataclass(frozen=True, eq=False)
class BagTable:
    """The arm of a bag."""

    columns: dict[str, np.ndarray]  # at the instants of the positions, shape (messages,)
    own_clocks: dict[str, OwnClock]  # of the columns of other topics, by name
    joint_names: tuple[str, ...]  # of the robot, or as the messages call them
    aside: tuple[str, ...]  # other topics with positions
    beside: dict[str, str]  # what else the bag holds, and why it is not used, by topic


def bag_table(path: Path, joint_names: tuple[str, ...] = ()) -> BagTable:
    """Choose the topic with the joints' positions, and take from others what it lacks."""
    bag = open_bag(path)
    joint_names = joint_names or _labels(bag)
    held = {
        table.name: [s for s in column_series(_names(table), joint_names) if s.channel in KINDS]
        for table in bag.topics.values()
    }
    main = max(bag.topics.values(), key=lambda table: _merit(table, held[table.name]))
    kind = STAMP if main.stamps is not None else RECEIVED
    clocks = [f"{main.name}/{k}" for k in dict.fromkeys((kind, RECEIVED))]
    columns = {name: bag.column(name) for name in (*_names(main), *clocks)}
    here = {KINDS[str(s.channel)] for s in held[main.name]}
    grid = bag.times(main, kind)
    lead = float(np.median(grid - bag.times(main, RECEIVED)))
    joints = [s for s in held[main.name] if s.channel == "q"]
    own: dict[str, OwnClock] = {}
    for table in bag.topics.values():
        for series in held[table.name]:
            if table is main or KINDS[str(series.channel)] in here or not _alike(series, joints):
                continue
            channel = _channel(bag, path, series)
            if channel is None or abs(float(channel.lead or 0.0) - lead) > ONE_CLOCK:
                continue
            values = at_instants(channel, grid)
            if np.isfinite(values[:, 0]).mean() < COVERED:
                continue
            clock = OwnClock(channel.clock, channel.rate)
            for j, name in enumerate(series.columns.values()):
                columns[name], own[name] = values[:, j], clock
    others = [table.name for table in bag.topics.values() if table is not main]
    aside = tuple(name for name in others if any(s.channel == "q" for s in held[name]))
    return BagTable(columns, own, joint_names, aside, dict(bag.passed_over))


def _labels(bag: Bag) -> tuple[str, ...]:
    """Names of joints in the messages: what stands behind the name of a field of joints."""
    names = [n.rpartition("/") for table in bag.topics.values() for n in table.columns]
    fields = {field: read_words(words_of(field)).channel for field, _, _ in names}
    return tuple(dict.fromkeys(j for f, _, j in names if fields[f] and not j.isdecimal()))


def _names(table: TopicTable) -> list[str]:
    """Names of a topic's columns in full, those of its clocks left out."""
    return [f"{table.name}/{column}" for column in table.columns]


def _merit(table: TopicTable, held: list[Series]) -> tuple[float, ...]:
    """How much a topic looks like the joint states: positions and torques of many known joints."""
    positions = [s for s in held if s.channel == "q"]
    torques = any(KINDS[str(s.channel)] == "tau" for s in held)
    return (
        bool(positions),
        torques,
        max((s.named for s in positions), default=False),
        max((len(s.columns) for s in positions), default=0),
        len(table.received),
    )


def _alike(series: Series, positions: list[Series]) -> bool:
    """Whether a series belongs to the joints of the positions: by name, or as many of them."""
    return series.named or any(len(series.columns) == len(own.columns) for own in positions)


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


def _channel(bag: Bag, path: Path, series: Series) -> ClockedChannel | None:
    """Values of a series with their stamps, or None where nothing can be made of them."""
    try:
        found = bag_channel(
            bag, path, KINDS[str(series.channel)], list(series.columns.values()), True
        )
    except PividentError:  # joints whose messages share no time, or have gaps
        return None
    good = np.isfinite(found.values).all(axis=1)
    if not good.all() and str(series.channel).endswith("_ref"):
        return None  # a reading would refuse the log for it, which is worth more than a reference
    found = replace(found, t=found.t[good], values=found.values[good])
    if len(found.t) < 3 or (np.diff(found.t) <= 0).any() or found.rate < SLOWEST:
        return None
    return found
