"""Where the numbers of a message lie, found once for all messages of the same structure.

A message is bytes in the order of its definition. Lengths and strings decide where everything
else lies; two messages that agree in these have their numbers at the same places. So one message is
walked field by field, and thousands like it are read as columns of one array of bytes.

ROS 1 packs fields without gaps, little-endian. ROS 2 (CDR) puts each number on a multiple of its
own size, counted behind four bytes that give the byte order, and ends strings with a zero.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import numpy as np

from pivident.data.logs.bags.message_definitions import NUMBERS, Definitions
from pivident.foundation.errors import FileFormatError

#: Most fields that are visited in one message, array elements of composite types included.
MAX_VISITS = 20_000

#: Bytes that a writer may leave behind the last field.
PADDING = 8

#: Fields of strings that name the elements of the arrays beside them.
NAMING = ("name", "names", "joint_names", "interface_names")

#: Packages whose types are no states of drives where they stand in arrays: points of trajectories,
#: transforms, markers.
NO_STATES = {
    f"{name}_msgs"
    for name in "diagnostic geometry nav sensor std tf2 trajectory vision visualization".split()
}

#: Names of the fields that lead somewhere; for an element of an array its number and how many.
Path = tuple[str | tuple[int, int], ...]


class _Unreadable(Exception):
    """The message is not what its definition says."""


@dataclass(frozen=True, eq=False)
class Run:
    """Floats that lie in one row."""

    path: Path  # the fields that lead there
    offset: int  # first byte
    count: int | None  # how many, or None for a single value that is no array
    code: str  # numpy's code of one of them
    beside: tuple[str, ...] = ()  # names beside the array in an element of another array

    def columns(self, names: tuple[str, ...]) -> list[str]:
        """Names of its columns: by joint where there is one name for each, else by number."""
        base = "/".join(part for part in self.path if isinstance(part, str))
        for part in self.path:
            if not isinstance(part, str):
                element, count = part
                label = names[element] if len(names) == count else str(element)
                if self.count is not None and len(self.beside) == self.count:
                    return [f"{base}/{own}/{label}" for own in self.beside]
                base = f"{base}/{label}"
        if self.count is None:
            return [base]
        within = len(self.path) > sum(isinstance(part, str) for part in self.path)
        named = len(names) == self.count and not within
        labels = names if named else [str(k) for k in range(self.count)]
        return [f"{base}/{label}" for label in labels]

    def of(self, stack: np.ndarray) -> np.ndarray:
        """Its values in messages, shape (messages, count); stack (messages, size)."""
        width = int(self.code[-1]) * (1 if self.count is None else self.count)
        part = np.ascontiguousarray(stack[:, self.offset : self.offset + width])
        return part.view(self.code).astype(float)


@dataclass(frozen=True, eq=False)
class Layout:
    """The structure of a message."""

    size: int  # of the message [bytes]
    runs: tuple[Run, ...]  # its floats
    names: tuple[str, ...]  # the names in it, of the joints as a rule
    stamp: int | None  # first byte of the header's time stamp, or None
    order: str  # ``<`` or ``>``
    places: np.ndarray  # bytes that make the structure, with ``bytes_there``
    bytes_there: np.ndarray
    visits: int = 0  # fields that the walk met

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of all columns."""
        return tuple(name for run in self.runs for name in run.columns(self.names))

    def fits(self, stack: np.ndarray) -> np.ndarray:
        """Which messages have this structure, shape (messages,)."""
        return (stack[:, self.places] == self.bytes_there).all(axis=1)

    def values(self, stack: np.ndarray) -> np.ndarray:
        """All columns of messages of this structure, shape (messages, columns)."""
        if not self.runs:
            return np.empty((len(stack), 0))
        return np.hstack([run.of(stack) for run in self.runs])

    def stamps(self, stack: np.ndarray) -> np.ndarray | None:
        """Header stamps of messages of this structure, shape (messages,) [ns]."""
        if self.stamp is None:
            return None
        words = np.ascontiguousarray(stack[:, self.stamp : self.stamp + 8])
        words = words.view(f"{self.order}u4").astype(np.int64)
        return words[:, 0] * 1_000_000_000 + words[:, 1]


def layout_of(message: bytes, type_name: str, definitions: Definitions, cdr: bool) -> Layout:
    """Walk one message."""
    try:
        walk = _Walk.begin(message, definitions, cdr)
        walk.message(type_name, ())
        if not 0 <= len(message) - walk.at < PADDING:
            raise _Unreadable(f"{len(message) - walk.at} bytes are left over")
    except (_Unreadable, struct.error, UnicodeDecodeError) as error:
        raise FileFormatError(
            f"a message of type {type_name[:80]!a} is not what its definition says ({error})"
        ) from None
    places = np.array([k for start, stop in walk.structure for k in range(start, stop)], dtype=int)
    content = np.frombuffer(message, np.uint8)
    names = next((walk.names[(key,)] for key in NAMING if walk.names.get((key,))), ())
    return Layout(
        len(message), tuple(walk.named_runs()), names, walk.stamp, walk.order, places,
        content[places], walk.visits,
    )  # fmt: skip


@dataclass
class _Walk:
    """A place in a message, and what was met on the way."""

    data: bytes
    definitions: Definitions
    cdr: bool
    order: str
    at: int
    visits: int = 0
    runs: list[Run] = field(default_factory=list)
    names: dict[Path, tuple[str, ...]] = field(default_factory=dict)
    stamp: int | None = None
    structure: list[tuple[int, int]] = field(default_factory=list)

    @classmethod
    def begin(cls, data: bytes, definitions: Definitions, cdr: bool) -> _Walk:
        """At the first field."""
        if not cdr:
            return cls(data, definitions, False, "<", 0)
        if len(data) < 4 or data[0] != 0 or data[1] not in (0, 1):
            raise _Unreadable(f"its encoding {data[:2].hex()} is not plain CDR")
        walk = cls(data, definitions, True, "<" if data[1] else ">", 4)
        walk.structure.append((0, 2))
        return walk

    def named_runs(self) -> Iterator[Run]:
        """All runs, those in elements of arrays with the names that stand beside them."""
        for run in self.runs:
            beside = [self.names.get((*run.path[:-1], key)) for key in NAMING]
            inside = any(not isinstance(part, str) for part in run.path)
            found = next((own for own in beside if own), ()) if inside else ()
            yield replace(run, beside=found) if found else run

    def message(self, type_name: str, path: Path | None) -> None:
        """All fields of a type; without a path they are passed over."""
        fields = self.definitions[type_name]
        if not fields and self.cdr:
            self._skip(1)  # C++ has no empty structures
        for entry in fields:
            self.visits += 1
            if self.visits > MAX_VISITS:
                raise _Unreadable(f"it has more than {MAX_VISITS} fields")
            below = None if path is None else (*path, entry.name)
            if entry.count is None:
                self._single(entry.type, below)
            else:
                self._array(entry.type, self._length() if entry.count < 0 else entry.count, below)

    def _single(self, type_name: str, path: Path | None) -> None:
        """One value."""
        if type_name == "time":
            self._align(4)
            if path == ("header", "stamp"):
                self.stamp = self.at
            self._skip(8)
        elif type_name in NUMBERS:
            self._numbers(type_name, 1, path, None)
        elif type_name == "string":
            self._string()
        elif type_name == "wstring":
            raise _Unreadable("it has wide strings")
        else:
            self.message(type_name, path)

    def _array(self, type_name: str, count: int, path: Path | None) -> None:
        """Several values of one type."""
        if type_name in NUMBERS:
            self._numbers(type_name, count, path, count)
            return
        if count > len(self.data):
            raise _Unreadable(f"an array of {count} elements lies in {len(self.data)} bytes")
        if type_name == "string":
            texts = tuple(self._string() for _ in range(count))
            self.visits += count
            if path is not None and path[-1] in NAMING:
                self.names[path] = texts
            return
        states = path is not None and type_name.partition("/")[0] not in NO_STATES
        for element in range(count):
            self.visits += 1
            if self.visits > MAX_VISITS:
                raise _Unreadable(f"it has more than {MAX_VISITS} fields")
            self._single(type_name, (*path, (element, count)) if path and states else None)

    def _numbers(self, type_name: str, count: int, path: Path | None, length: int | None) -> None:
        """Numbers in a row, kept where they are floats."""
        size, code = NUMBERS[type_name]
        if count == 0:
            return
        self._align(size)
        start = self.at
        self._skip(size * count)
        if path is not None and code.startswith("f"):
            self.runs.append(Run(path, start, length, self.order + code))

    def _length(self) -> int:
        """The length that stands before a sequence or a string."""
        self._align(4)
        start = self.at
        self._skip(4)
        self.structure.append((start, self.at))
        return int(struct.unpack_from(f"{self.order}I", self.data, start)[0])

    def _string(self) -> str:
        """A string, which belongs to the structure."""
        length = self._length()
        start = self.at
        self._skip(length)
        self.structure.append((start, self.at))
        return self.data[start : self.at].decode().rstrip("\0")

    def _align(self, size: int) -> None:
        """Go to the next multiple of a number's size."""
        if self.cdr:
            self.at += -(self.at - 4) % size

    def _skip(self, size: int) -> None:
        """Go on, inside the message."""
        self.at += size
        if self.at > len(self.data):
            raise _Unreadable("it is too short")
