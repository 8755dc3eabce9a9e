"""Source files: that they exist, what they hash to, that they are not archive bombs.

A table in memory in the place of a file: a data frame of any library, or arrays by name.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from pivident.foundation.errors import FileFormatError, RecordingError, UnknownColumn
from pivident.foundation.files import regular_file
from pivident.foundation.text.identifiers import escaped
from pivident.foundation.text.sentences import near_names

#: A file may expand to this many bytes without question.
HARMLESS_SIZE = 256 * 2**20

#: Beyond that it may expand by this factor. Logs as text shrink four- to tenfold.
MAX_EXPANSION = 200

#: Names of the files that hold the messages of a ROS 2 bag.
_BAG_PART = re.compile(r"\.(db3|mcap)(\.zstd|\.zst)?$")


@dataclass(frozen=True)
class SourceFile:
    """Where numbers come from, without saying on whose machine."""

    name: str  # file name without its folder
    sha256: str  # hash of the file's bytes, hexadecimal

    @classmethod
    def of(cls, path: str | PathLike[str]) -> SourceFile:
        """Name and hash of a file on disk, or of the files of a bag's folder."""
        path = Path(path)
        path = path if path.is_dir() else existing_file(path)
        return cls(escaped(path.name), sha256(path))


def printable_name(path: Path) -> str:
    """Name of a file as it can be printed and written: it may hold any byte."""
    return escaped(path.name.encode("utf-8", "backslashreplace").decode())


def existing_file(path: str | PathLike[str]) -> Path:
    """The path, once it is known to be a file with content that can be opened."""
    path = Path(path)
    try:
        with regular_file(path).open("rb") as stream:
            empty = not stream.read(1)
    except IsADirectoryError:
        raise FileFormatError(
            f"{path.name} is a folder", advice="name the file with the record in it"
        ) from None
    except OSError as error:
        raise FileFormatError(
            f"{path} cannot be opened ({error.strerror})", advice="check its name and permissions"
        ) from error
    if empty:
        raise FileFormatError(f"{path.name} is empty", advice="export the log again")
    return path


def state_of(path: Path) -> tuple[int, int, int]:
    """What changes when a file is written again."""
    try:
        about = regular_file(path).stat()
    except OSError as error:
        raise FileFormatError(f"{path.name} cannot be opened ({error.strerror})") from error
    return about.st_ino, about.st_size, about.st_mtime_ns


def bag_files(folder: Path) -> list[Path]:
    """The files of a ROS 2 bag that hold its messages, in the order of their numbers."""
    try:
        files = [file for file in folder.iterdir() if _BAG_PART.search(file.name.lower())]
    except OSError as error:
        raise FileFormatError(f"{folder} cannot be opened ({error.strerror})") from error
    if not files:
        raise FileFormatError(
            f"{folder.name} is a folder without the .db3 or .mcap files of a ROS 2 bag",
            advice="name the file with the record in it",
        )
    return sorted(files, key=lambda file: [int(n) for n in re.findall(r"\d{1,9}", file.name)])


def sha256(path: Path) -> str:
    """SHA-256 of a file's bytes, or of the hashes of a bag's files by name, hexadecimal."""
    if path.is_dir():
        lines = [f"{escaped(file.name)} {sha256(file)}" for file in bag_files(path)]
        return hashlib.sha256("\n".join(lines).encode("utf-8", "backslashreplace")).hexdigest()
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def refuse_bomb(path: Path, expanded: int) -> None:
    """Refuse a file that promises to expand beyond what a log would."""
    stored = path.stat().st_size
    if expanded > HARMLESS_SIZE and expanded > MAX_EXPANSION * stored:
        raise FileFormatError(
            f"{path.name} expands from {stored} to at least {expanded} bytes, more than "
            f"{MAX_EXPANSION} times its size",
            advice="store it uncompressed if this is no mistake",
        )


class SupportsColumns(Protocol):
    """A data frame: ``frame[name]`` is a column, ``frame.columns`` has the names."""

    columns: Any

    def __getitem__(self, name: Any, /) -> Any:
        """A column by its name."""
        ...


@dataclass(frozen=True, eq=False)
class Frame:
    """Columns that are had by their names.

    Attributes:
        table: a frame of pandas or polars, a dictionary of arrays, or anything else with
            ``table[name]`` and its names as ``columns`` or ``keys()``.
        name: what messages call it.
    """

    table: Any
    name: str = "the frame"

    @staticmethod
    def is_one(files: Any) -> bool:
        """Whether an argument is a table, rather than a path or several by key."""
        if isinstance(files, Mapping):
            return not all(isinstance(path, str | PathLike) for path in files.values())
        return hasattr(files, "columns") and hasattr(files, "__getitem__")

    @property
    def names(self) -> tuple[str, ...]:
        """Names of its columns."""
        named = self.table.keys() if isinstance(self.table, Mapping) else self.table.columns
        return tuple(map(str, named))

    @property
    def source(self) -> SourceFile:
        """Hash of the bytes of its columns of numbers, in their order."""
        digest = hashlib.sha256()
        for name in self.names:
            values = np.ascontiguousarray(self.table[name])
            if values.dtype.kind in "fiubmM":
                digest.update(values.tobytes())
        return SourceFile(self.name, digest.hexdigest())

    def read(self, names: Sequence[str]) -> dict[str, np.ndarray]:
        """Some columns as numbers; times of day as seconds since the first sample.

        Raises:
            UnknownColumn: there is no such column; names the nearest ones.
            RecordingError: a column holds something else than numbers.
        """
        return {name: self._numbers(name) for name in names}

    def _numbers(self, name: str) -> np.ndarray:
        """One column."""
        if name not in self.names:
            raise UnknownColumn(self.name, name, near_names(name, self.names), self.names)
        values = np.asarray(self.table[name])
        if values.dtype.kind == "M":
            values = values - values[:1]
        if values.dtype.kind == "m":
            return values / np.timedelta64(1, "s")
        try:
            return np.asarray(values, dtype=float)
        except (TypeError, ValueError) as error:
            raise RecordingError(
                f"column {name!r} of {self.name} holds no numbers ({error})",
                advice="convert it, or name another one",
            ).about("columns") from None
