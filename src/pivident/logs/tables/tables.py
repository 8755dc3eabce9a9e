"""One way to read every kind of file: names first, then only the arrays that are needed."""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from functools import cache
from itertools import islice
from pathlib import Path

import numpy as np

from pivident.errors import FileFormatError, UnknownColumn
from pivident.logs.bags.read_bag import BAG, is_bag
from pivident.logs.reader import Reader
from pivident.logs.source_files import existing_file
from pivident.registry import Registry
from pivident.robot.naming import near_names
from pivident.text.printable import is_printable

#: Longest name of a column or an array, in characters.
MAX_NAME = 500

#: Endings of spreadsheets, which are not read.
SPREADSHEETS = (".xlsx", ".xls", ".xlsm", ".ods")

#: All readers by name.
READERS = Registry(
    "pivident.readers",
    Reader,
    {
        "csv": "pivident.logs.tables.read_csv:CSV",
        "npz": "pivident.logs.tables.read_npz:NPZ",
        "npy": "pivident.logs.tables.read_npz:NPY",
        "mat": "pivident.logs.tables.read_mat:MAT",
        "parquet": "pivident.logs.tables.read_parquet:PARQUET",
        "bag": "pivident.logs.bags.read_bag:BAG",
    },
)

#: Files that a message about a folder names, levels of folders in which they are looked for, and
#: entries of a level that are looked at.
MAX_FILES, FOLDERS, MAX_ENTRIES = 3, 3, 10_000


@cache
def readers() -> tuple[Reader, ...]:
    """All readers that can be imported, those of pivident first."""
    return tuple(READERS.usable().values())


def endings() -> tuple[str, ...]:
    """Endings of the names of all files that are read."""
    return tuple(dict.fromkeys(ending for reader in readers() for ending in reader.endings))


def is_log(name: str) -> bool:
    """Whether a file of this name is read as a log."""
    return any(reader.takes(name) for reader in readers())


def names_in(path: str | Path) -> tuple[str, ...]:
    """Names of the columns or arrays in a file, without loading them."""
    path = Path(path)
    reader = reader_of(path)
    if not (reader.is_text or os.path.isdir(path)):
        _refuse_text(path)
    names = reader.names(path)
    for name in names:
        if len(name) > MAX_NAME or not is_printable(name):
            what = "control characters" if len(name) <= MAX_NAME else f"{len(name)} characters"
            raise FileFormatError(
                f"{path.name} has a column or array whose name has {what}, {name[:20]!r}…",
                advice="rename it",
            )
    return names


def read_table(path: str | Path, names: Sequence[str] | None = None) -> dict[str, np.ndarray]:
    """Columns or arrays of a file by name."""
    path = Path(path)
    readable = names_in(path)
    for name in names or ():
        if name not in readable:
            raise UnknownColumn(path.name, name, near_names(name, readable), readable)
    return reader_of(path).read(path, names)


def unread_in(path: str | Path) -> dict[str, str]:
    """What a file holds beside the columns and arrays that can be read: why not, by name."""
    path = Path(path)
    return reader_of(path).unread(path)


def _refuse_text(path: Path) -> None:
    """Refuse a table of text whose ending promises another kind of file."""
    with path.open("rb") as stream:
        beginning = stream.read(1024)
    if len(beginning) > 16 and all(byte in b"\t\r\n" or 32 <= byte < 127 for byte in beginning):
        raise FileFormatError(
            f"{path.name} is text, not a {path.suffix} file",
            advice="give it the ending .csv, or export it again",
        )


def _folder(path: Path) -> FileFormatError:
    """What to do about a folder that is no bag: the logs in it, or a pattern for them."""
    levels = (path.glob("/".join("*" * level)) for level in range(1, FOLDERS + 1))
    logs = next(filter(None, map(_logs_of, levels)), [])
    names = [file.relative_to(path.parent).as_posix() for file in logs]
    pattern = f"{names[0].rpartition('/')[0]}/*{logs[0].suffix}" if logs else f"{path.name}/*.csv"
    more = " …" if len(names) > MAX_FILES else ""
    listed = f" ({', '.join(names[:MAX_FILES])}{more})" if logs else ""
    return FileFormatError(
        f"{path.name} is a folder",
        advice=f"name the file with the record in it{listed}, or a pattern such "
        f'as "{pattern}" for all of its runs',
    )


def _logs_of(files: Iterable[Path]) -> list[Path]:
    """Those of the first files that seem to be logs, sorted; a .txt may be anything."""
    read = {*endings()} - {".txt"}
    return [file for file in sorted(islice(files, MAX_ENTRIES)) if file.suffix.lower() in read]


def reader_of(path: Path) -> Reader:
    """The reader of a file that has content, by its name; of a folder, by what is in it.

    Raises:
        FileFormatError: there is none, or the file cannot be opened or is empty.
    """
    if os.path.isdir(path):  # takes any name
        if is_bag(path):
            return BAG
        raise _folder(path)
    for reader in readers():
        if reader.takes(path.name):
            existing_file(path)
            return reader
    suffix = Path(path.name.lower().removesuffix(".gz")).suffix
    if suffix in SPREADSHEETS:
        raise FileFormatError(
            f"{path.name}: no reader for this kind of file, the workbook of a spreadsheet program",
            advice="export its sheet as CSV",
        )
    if suffix in (".urdf", ".xacro"):
        raise FileFormatError(
            f"{path.name} is a robot description, not a log",
            advice=f"name the log, and the robot as --robot {path.name}",
        )
    raise FileFormatError(
        f"{path.name}: no reader for this kind of file",
        advice=f"use one of {', '.join(endings())} or a gzipped text table",
    )
