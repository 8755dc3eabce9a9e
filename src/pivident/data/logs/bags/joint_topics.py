"""From the messages of a topic and its sources to columns by joint.

Messages are kept as bytes for a moment, a few thousand at a time, and then read together: those of
the same structure are rows of one array. A column that is not in every message, because the topic
has several publishers or its joints come in turns, keeps the rows in which it is.

The sources of one topic: messages that contradict each other come from different publishers.

A driver sends positions, speeds and efforts; beside it a node for a display sends positions of the
same joints, often zeros, in an order of its own. A bag does not say who sent a message. Messages
with the same columns in the same order are taken for one source. Two of these are separate where
they fill other arrays of the same joint, or say other values of it; joints that come in turns, or
that change places, are not.
"""

from __future__ import annotations

import warnings
from collections import defaultdict, deque
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import chain
from pathlib import Path

import numpy as np

from pivident.data.logs.bags.bag_containers import MAX_MESSAGE, Topic
from pivident.data.logs.bags.message_definitions import (
    KNOWN,
    Definitions,
    parse_definition,
    short_name,
)
from pivident.data.logs.bags.message_layout import MAX_VISITS, Layout, layout_of
from pivident.data.logs.source_files import refuse_bomb
from pivident.foundation.errors import FileFormatError
from pivident.foundation.scratch import working_array
from pivident.foundation.text.sentences import listed, plural

#: Messages that are read together, and the bytes that they may have.
TOGETHER, BYTES_TOGETHER = 4096, 2**24
#: Structures that are remembered for the next messages of a topic.
REMEMBERED = 16
#: Structures that may appear once before messages are no longer compared with the next ones.
LONELY = 8
#: Most columns of a topic.
MAX_COLUMNS = 2_000
#: Fields that may be visited in search of structures, in one bag and in one of its topics. Bags
#: from recorders need some hundreds; one whose every message is built differently ends here.
VISITS_OF_BAG, VISITS_OF_TOPIC = 2**23, 2**22
#: What one walk costs beside its fields, in visits, and characters of a definition for one visit.
WALK, READ_IN_A_VISIT = 40, 20
#: Columns of messages of one structure, their rows in the topic, numbers, and stamps or None.
Part = tuple[tuple[str, ...], np.ndarray, np.ndarray, np.ndarray | None]
#: Share of the messages of the largest source from which on another can be the one that is used.
SUBSTANTIAL = 0.05
#: Median difference of two sources that agree, as share of the range of their values.
AGREE = 0.05
#: Most sources that are compared; messages that are built in more ways are left together.
MAX_SOURCES = 32


@dataclass(frozen=True, eq=False)
class TopicTable:
    """A topic as columns."""

    name: str  # name of the topic
    received: np.ndarray  # when each message was received, shape (messages,) [ns]
    stamps: np.ndarray | None  # of the headers, shape (messages,) [ns], or None
    columns: dict[str, np.ndarray]  # by field and joint (``position/elbow``), or NaN
    rows: dict[str, np.ndarray]  # messages with a column, where not all have it
    left_out: str = ""  # messages of other sources that were left out, in words

    def rows_of(self, column: str) -> np.ndarray:
        """Indices of the messages that hold a column."""
        rows = self.rows.get(column)
        return np.arange(len(self.received)) if rows is None else rows


@dataclass
class WorkBudget:
    """How much work the structures of a bag's messages may still make; shared by its topics."""

    left: int = VISITS_OF_BAG  # visits of fields

    def spend(self, visits: int) -> None:
        """Take some of it; what is owed may go below zero."""
        self.left -= visits


def one_source(parts: Sequence[Part], received: np.ndarray) -> tuple[list[Part], str]:
    """The parts without what contradicts a better source, and what was left out in words.

    Args:
        parts: of one topic.
        received: when each message was received, shape (messages,) [ns].
    """
    sources: dict[tuple[str, ...], list[Part]] = defaultdict(list)
    for part in parts:
        sources[part[0]].append(part)
    if not 1 < len(sources) <= MAX_SOURCES:
        return list(parts), ""
    sizes = {names: sum(len(part[1]) for part in own) for names, own in sources.items()}
    few = SUBSTANTIAL * max(sizes.values())

    def merit(names: tuple[str, ...]) -> tuple[bool, int, int]:
        changing = _fields(_changing(sources[names]))
        return sizes[names] >= few, len(changing), sizes[names] * len(names)

    taken: list[list[Part]] = []
    left_out: list[str] = []
    for names in sorted(sources, key=merit, reverse=True):
        others = [own for own in taken if not _alike(own, sources[names], received)]
        rest = [k for k, name in enumerate(names) if not any(name in own[0][0] for own in others)]
        if len(rest) < len(names):
            what = listed(sorted(_fields(names)), 4)
            alone = dict.fromkeys(name.rpartition("/")[2] for name in names)
            left_out.append(f"{sizes[names]} ({what} of {plural(len(alone), 'joint')})")
        if rest:
            own = tuple(names[k] for k in rest)
            taken.append([(own, rows, x[:, rest], t) for _, rows, x, t in sources[names]])
    if not left_out:
        return list(parts), ""
    return list(chain.from_iterable(taken)), (
        f"{listed(left_out, 4)} of {len(received)} messages come from other sources of the same "
        "joints and are left out"
    )


def _changing(parts: Sequence[Part]) -> list[str]:
    """The columns whose finite values are not all the same."""
    names, numbers = parts[0][0], [numbers for _, _, numbers, _ in parts]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # a column may have no number at all
        low = np.nanmin([np.nanmin(x, axis=0) for x in numbers], axis=0)
        high = np.nanmax([np.nanmax(x, axis=0) for x in numbers], axis=0)
    return [name for name, changes in zip(names, low < high, strict=True) if changes]


def _fields(names: Sequence[str]) -> set[str]:
    """The arrays that are filled."""
    return {name.rpartition("/")[0] or name for name in names}


def _alike(first: Sequence[Part], second: Sequence[Part], received: np.ndarray) -> bool:
    """Whether two sources fill the same arrays of the joints that both have, with values alike."""
    one, other = first[0][0], second[0][0]
    shared = sorted(set(one) & set(other))
    joints = {name.rpartition("/")[2] for name in shared}
    if any(n.rpartition("/")[2] in joints for n in set(one) ^ set(other)):
        return False
    agreeing = 0
    for name in shared:
        (t, x), (s, y) = (_values(parts, name, received) for parts in (first, second))
        if not (t.size and s.size):
            agreeing += 1
            continue
        span = max(float(x.max()), float(y.max())) - min(float(x.min()), float(y.min()))
        agreeing += float(np.median(np.abs(np.interp(s, t, x) - y))) <= AGREE * span
    return 2 * agreeing >= len(shared)


def _values(
    parts: Sequence[Part], name: str, received: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Times and finite values of a column, in the order of time."""
    t = np.concatenate([received[rows] for _, rows, _, _ in parts]).astype(float)
    x = np.concatenate([numbers[:, names.index(name)] for names, _, numbers, _ in parts])
    order = np.argsort(t, kind="stable")
    order = order[np.isfinite(x[order])]
    return t[order], x[order]


@dataclass
class TopicReader:
    """Takes the messages of one topic, one by one."""

    topic: Topic
    budget: WorkBudget = field(default_factory=WorkBudget)  # what all topics of the bag share
    why_not: str = ""  # why its messages cannot be read, empty as long as they can
    _versions: list[Definitions] = field(default_factory=list)
    _waiting: list[bytes] = field(default_factory=list)
    _bytes: int = 0
    _received: list[int] = field(default_factory=list)
    _layouts: deque[Layout] = field(default_factory=lambda: deque(maxlen=REMEMBERED))
    _parts: list[Part] = field(default_factory=list)
    _names: set[str] = field(default_factory=set)
    _read: int = 0
    _visits: int = 0

    def __post_init__(self) -> None:
        known = KNOWN.get(short_name(self.topic.type), ())
        texts = (self.topic.definition,) if self.topic.definition.strip() else known
        if not self.topic.readable or not texts:
            self.why_not = "its encoding or type is not known"
            return
        if self.budget.left <= 0:
            self.why_not = "the messages before it are built in too many ways"
            return
        self.budget.spend(sum(map(len, texts)) // READ_IN_A_VISIT)
        try:
            self._versions = [parse_definition(self.topic.type, text) for text in texts]
        except FileFormatError as error:
            self.why_not = str(error)

    def take(self, received: int, message: bytes) -> None:
        """Keep a message until enough have come together; received [ns]."""
        if len(message) > MAX_MESSAGE:
            self.give_up("its messages are larger than those of joints")
            return
        self._waiting.append(message)
        self._received.append(received)
        self._bytes += len(message)
        if len(self._waiting) >= TOGETHER or self._bytes >= BYTES_TOGETHER:
            self._read_waiting()

    def give_up(self, reason: str) -> None:
        """Pass the topic over from here on, and forget what it said."""
        self.why_not = reason
        for kept in (self._waiting, self._received, self._parts, self._layouts):
            kept.clear()

    def table(self, path: Path) -> TopicTable | None:
        """All columns, or None where the topic cannot be read or holds no floats."""
        self._read_waiting()
        if self.why_not or not self._names:
            return None
        received = np.array(self._received, dtype=np.int64)
        parts, left_out = one_source(self._parts, received)
        self._parts.clear()
        names = list(dict.fromkeys(name for part in parts for name in part[0]))
        samples = len(received)
        refuse_bomb(path, 8 * len(names) * samples)
        place = {name: k for k, name in enumerate(names)}
        values = working_array((len(names), samples))
        every = set(names)
        used = np.zeros(samples, dtype=bool)
        together = not left_out and all(set(part[0]) == every for part in parts)
        present = np.zeros((0 if together else len(names), samples), dtype=bool)
        stamps = np.zeros(samples, dtype=np.int64)
        if not together:
            values[:] = np.nan
        for own, rows, numbers, stamped in parts:
            used[rows] = True
            for k, name in enumerate(own):
                values[place[name], rows] = numbers[:, k]
                if not together:
                    present[place[name], rows] = True
            if stamped is not None:
                stamps[rows] = stamped
        order = np.argsort(received, kind="stable")
        if left_out:
            order = order[used[order]]
        if left_out or (order[1:] < order[:-1]).any():  # chunks of a bag may overlap in time
            values, received, stamps = values[:, order], received[order], stamps[order]
            present = present[:, order]
        values.flags.writeable = False  # it is kept for whoever asks next
        return TopicTable(
            self.topic.name,
            received,
            stamps if stamps.any() else None,
            dict(zip(names, values, strict=True)),
            {n: np.flatnonzero(p) for n, p in zip(names, present, strict=False) if not p.all()},
            left_out,
        )

    def _read_waiting(self) -> None:
        """Read the messages that wait, those of the same size together."""
        waiting, self._waiting, self._bytes = self._waiting, [], 0
        if not waiting or self.why_not:
            return
        sizes = np.array([len(message) for message in waiting])
        try:
            for size in np.unique(sizes):
                places = np.flatnonzero(sizes == size)
                content = b"".join(waiting[k] for k in places)
                stack = np.frombuffer(content, np.uint8).reshape(len(places), size)
                self._read_stack(stack, self._read + places)
        except FileFormatError as error:
            self.give_up(str(error))
        self._read += len(waiting)

    def _read_stack(self, stack: np.ndarray, rows: np.ndarray) -> None:
        """Read messages of one size: by structures met before, then by new ones."""
        for layout in tuple(self._layouts):
            if layout.size == stack.shape[1] and len(stack):
                stack, rows = self._keep(layout, stack, rows)
        lonely = 0
        while len(stack):
            layout = self._layout(stack[0].tobytes())
            if lonely < LONELY:
                before = len(stack)
                self._layouts.append(layout)
                stack, rows = self._keep(layout, stack, rows)
                lonely = lonely + 1 if before - len(stack) == 1 else 0
            else:
                self._store(layout, stack[:1], rows[:1])
                stack, rows = stack[1:], rows[1:]

    def _keep(
        self, layout: Layout, stack: np.ndarray, rows: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Store the messages of a structure; the others come back."""
        fits = layout.fits(stack)
        if fits.all():
            self._store(layout, stack, rows)
            return stack[:0], rows[:0]
        if fits.any():
            self._store(layout, stack[fits], rows[fits])
        return stack[~fits], rows[~fits]

    def _store(self, layout: Layout, stack: np.ndarray, rows: np.ndarray) -> None:
        """Keep the numbers of messages of one structure."""
        names = layout.columns
        if len(set(names)) < len(names):
            raise FileFormatError("a message names the same joint twice")
        self._names.update(names)
        if len(self._names) > MAX_COLUMNS:
            raise FileFormatError(f"it has more than {MAX_COLUMNS} columns")
        self._parts.append((names, rows, layout.values(stack), layout.stamps(stack)))

    def _layout(self, message: bytes) -> Layout:
        """The structure of a message; the first one settles the version of its type."""
        if self._visits > VISITS_OF_TOPIC or self.budget.left <= 0:
            raise FileFormatError("its messages are built in too many ways")
        for version in tuple(self._versions):
            try:
                layout = layout_of(message, short_name(self.topic.type), version, self.topic.cdr)
            except FileFormatError:
                self._spend(MAX_VISITS)  # how far the walk came is not known
                if version is self._versions[-1]:
                    raise
                continue
            self._spend(layout.visits)
            self._versions = [version]
            return layout
        raise FileFormatError("its type has no definition")

    def _spend(self, visits: int) -> None:
        """Count the work of one walk."""
        self._visits += visits + WALK
        self.budget.spend(visits + WALK)
