"""Bags of ROS 1 (``.bag``) and ROS 2 (a folder, ``.db3``, ``.mcap``), column by column.

Every topic whose messages hold floats gives columns ``topic/field/joint``:

    /joint_states/position/elbow            sensor_msgs/JointState
    /arm_controller/state/actual/positions/elbow    control_msgs/JointTrajectoryControllerState
    /franka_states/q/0                      arrays without names, by number
    /lowstate/motor_state/tau_est/3         fields of the elements of arrays, by their number
    /dynamic_joint_states/interface_values/values/effort/elbow      or by the names beside them
    /joint_states/stamp                     time stamps of the headers [s], where there are any
    /joint_states/receive_time              when the recorder received each message [s]

Times count from midnight (UTC) of the day on which the bag begins, so that a double holds
nanoseconds and bags of one day share a clock. Other messages are passed over.
"""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np

from pivident.data.logs.bags.bag_containers import (
    Message,
    Topic,
    mcap_messages,
    ros1_messages,
    sqlite_messages,
)
from pivident.data.logs.bags.decompression import unpack_file
from pivident.data.logs.bags.joint_topics import TopicReader, TopicTable, WorkBudget
from pivident.data.logs.reader import Reader
from pivident.data.logs.source_files import bag_files, existing_file, state_of
from pivident.foundation.errors import FileFormatError
from pivident.foundation.text.identifiers import escaped

#: What reads which kind of file.
CONTAINERS: dict[str, Callable[[Path], Iterator[Message]]] = {
    ".bag": ros1_messages,
    ".db3": sqlite_messages,
    ".mcap": mcap_messages,
}

#: Columns of every topic that hold times [s].
STAMP, RECEIVED = "stamp", "receive_time"

_DAY = 86_400_000_000_000


@dataclass(frozen=True, eq=False)
class Bag:
    """A bag as tables."""

    topics: dict[str, TopicTable]  # tables of the topics by name
    start: int  # midnight before its first message [ns since 1970]; times count from there
    passed_over: dict[str, str]  # why a topic, or some of its messages, was not read, by its name

    def names(self) -> tuple[str, ...]:
        """Names of all columns."""
        return tuple(
            f"{table.name}/{name}"
            for table in self.topics.values()
            for name in (*table.columns, *((STAMP,) if table.stamps is not None else ()), RECEIVED)
        )

    def topic_of(self, column: str) -> TopicTable:
        """The table that a column belongs to."""
        parts = column.split("/")
        for k in range(len(parts) - 1, 0, -1):
            table = self.topics.get("/".join(parts[:k]))
            if table is not None:
                return table
        raise FileFormatError(f"no topic of the bag holds the column {column!r}")

    def times(self, table: TopicTable, kind: str) -> np.ndarray:
        """Stamps of a topic's messages, shape (messages,) [s]."""
        nanoseconds = table.received if kind == RECEIVED else table.stamps
        if nanoseconds is None:
            raise FileFormatError(
                f"the messages of {table.name} carry no time stamps",
                advice=f"take {table.name}/{RECEIVED}",
            )
        return (nanoseconds - self.start) / 1e9

    def column(self, name: str) -> np.ndarray:
        """One column, shape (messages,), NaN where a message lacks it."""
        table = self.topic_of(name)
        own = name[len(table.name) + 1 :]
        if own in table.columns:
            return table.columns[own]
        if own not in (STAMP, RECEIVED):
            raise FileFormatError(f"the topic {table.name} has no column {own!r}")
        return self.times(table, own)


def is_bag(path: str | Path) -> bool:
    """Whether a path is read as a bag: its ending says so, or it is a folder with one in it."""
    path = Path(path)
    if not os.path.isdir(path):  # which takes any name, as long or odd as it may be
        return BAG.takes(path.name)
    return any(BAG.takes(file.name) for file in path.iterdir())


def read_bag(path: str | Path, names: Sequence[str] | None = None) -> dict[str, np.ndarray]:
    """Columns of a bag; those of different topics differ in length."""
    bag = open_bag(path)
    return {name: bag.column(name) for name in (bag.names() if names is None else names)}


def open_bag(path: str | Path) -> Bag:
    """A bag read as a whole. The last one is kept, since names are asked for before columns."""
    path = Path(path)
    files = tuple(bag_files(path)) if path.is_dir() else (existing_file(path),)
    return _opened(path, tuple((file, *state_of(file)) for file in files))


@lru_cache(maxsize=1)
def _opened(path: Path, states: tuple[tuple[Path, int, int, int], ...]) -> Bag:
    """Read every message once."""
    readers: dict[Topic, TopicReader] = {}
    budget = WorkBudget()
    for file, *_ in states:
        for topic, received, message in _messages(file):
            reader = readers.get(topic)
            if reader is None:
                reader = readers[topic] = TopicReader(topic, budget)
            if not reader.why_not:
                reader.take(received, message)
    largest = max((file for file, *_ in states), key=lambda file: file.stat().st_size)
    tables: dict[str, TopicTable] = {}
    passed_over: dict[str, str] = {}
    for topic, reader in readers.items():
        table = reader.table(largest)
        if table is None:
            passed_over[topic.name] = reader.why_not or "its messages hold no floats"
        elif topic.name in tables:
            passed_over[topic.name] = "it has messages of several types; the first is read"
        else:
            tables[topic.name] = table
            if table.left_out:
                passed_over[topic.name] = table.left_out
    if not tables:
        raise _nothing(path, readers, passed_over)
    first = min(int(table.received[0]) for table in tables.values())
    return Bag(tables, first // _DAY * _DAY, passed_over)


def _nothing(
    path: Path, readers: dict[Topic, TopicReader], reasons: dict[str, str]
) -> FileFormatError:
    """Why a bag gave no columns."""
    if not readers:
        return FileFormatError(
            f"{path.name} holds no messages", advice="record the topic of the joint states"
        )
    shown = [
        f"{ascii(topic.name[:60])[1:-1]} ({ascii(topic.type[:60])[1:-1]}): "
        f"{escaped(reasons.get(topic.name, ''))[:120]}"
        for topic in list(readers)[:3]
    ]
    return FileFormatError(
        f"{path.name} has no topic whose messages hold joint states or other numbers",
        advice=f"{'; '.join(shown)}{'; …' if len(readers) > 3 else ''}",
    )


def _messages(file: Path) -> Iterator[Message]:
    """Messages of one file, which may be packed as a whole."""
    read = CONTAINERS.get(Path(file.name.lower().removesuffix(".zstd").removesuffix(".zst")).suffix)
    if read is None:
        raise FileFormatError(
            f"{file.name} is no bag", advice=f"use one of {', '.join(CONTAINERS)}"
        )
    if file.suffix.lower() not in (".zstd", ".zst"):
        yield from read(file)
        return
    with tempfile.TemporaryDirectory(prefix="pivident-") as folder:
        whole = Path(folder) / file.stem
        with whole.open("wb") as out:
            unpack_file(file, out)
        yield from read(whole)


#: The reader of bags; a folder with the files of one in it is a bag too.
BAG = Reader(
    tuple(CONTAINERS),
    lambda path: open_bag(path).names(),
    read_bag,
    lambda path: open_bag(path).passed_over,
    packed=(".zstd", ".zst"),
)
