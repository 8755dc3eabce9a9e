"""One way to read every kind of file: names first, given or read, then only the needed arrays.

Names that somebody gives to the columns of a table without a header.

Such a table calls its columns column_1, column_2 … The names are given in the order of the columns,
``-`` for one that needs none; ``q1..q7`` stands for q1, q2 … q7.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Mapping, Sequence
from functools import cache, lru_cache
from itertools import islice
from pathlib import Path

import numpy as np

from pivident.data.logs.bags.read_bag import BAG, is_bag
from pivident.data.logs.reader import Reader
from pivident.data.logs.source_files import existing_file, state_of
from pivident.foundation.errors import FileFormatError, RecordingError, UnknownColumn
from pivident.foundation.registry import Registry
from pivident.foundation.text.identifiers import is_printable
from pivident.robot.naming import near_names, repeated

#: Largest file whose columns are kept for the next reading [bytes].
MAX_KEPT = 2**23
#: Longest name of a column or an array, in characters.
MAX_NAME = 500
#: Endings of spreadsheets, which are not read.
SPREADSHEETS = (".xlsx", ".xls", ".xlsm", ".ods")
#: All readers by name.
READERS = Registry(
    "pivident.readers",
    Reader,
    {
        "csv": "pivident.data.logs.tables.read_csv:CSV",
        "npz": "pivident.data.logs.tables.read_npz:NPZ",
        "npy": "pivident.data.logs.tables.read_npz:NPY",
        "mat": "pivident.data.logs.tables.read_mat:MAT",
        "parquet": "pivident.data.logs.tables.read_parquet:PARQUET",
        "bag": "pivident.data.logs.bags.read_bag:BAG",
    },
)
#: Files that a message about a folder names, levels of folders in which they are looked for, and
#: entries of a level that are looked at.
MAX_FILES, FOLDERS, MAX_ENTRIES = 3, 3, 10_000
#: What stands for a column without a name.
UNNAMED = "-"
_NUMBERED = re.compile(r"column_\d+")
_RANGE = re.compile(r"(.*?)(\d{1,9})\.\.(.*?)(\d{1,9})")


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
    path, readable = Path(path), names_in(path)
    for name in names or ():
        if name not in readable:
            raise UnknownColumn(path.name, name, near_names(name, readable), readable)
    if path.is_dir() or path.stat().st_size > MAX_KEPT:
        return reader_of(path).read(path, names)
    wanted = None if names is None else tuple(names)
    return {name: x.copy(order="K") for name, x in _kept(path, state_of(path), wanted).items()}


@lru_cache(maxsize=2)
def _kept(
    path: Path, state: tuple[int, int, int], names: tuple[str, ...] | None
) -> dict[str, np.ndarray]:
    """Columns of a small file as it is now: forgiving and strict readings ask for the same."""
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


def named_columns(path: Path, names: Sequence[str]) -> dict[str, str]:
    """The column of a table without a header that each name means, in their order.

    Raises:
        RecordingError: the file has a header, or not as many columns as there are names.
    """
    names, own = written_out(names), names_in(path)
    if own[:1] != ("column_1",):
        listed = ", ".join(own[:6]) + (" …" if len(own) > 6 else "")
        raise RecordingError(
            f"{path.name} names its columns itself ({listed})",
            advice="column names are for text tables without a header: leave them out",
        )
    if len(own) != len(names):
        raise RecordingError(
            f"{path.name} has {len(own)} columns, but {len(names)} are named "
            f"({', '.join(names[:4])} …)",
            advice=f"name all in their order, {UNNAMED} for those that are not needed",
        )
    twice = repeated([name for name in names if name != UNNAMED])
    if twice:
        raise RecordingError(
            f"the column name {twice[0]!r} is given twice", advice="give each its own"
        )
    pairs = zip(names, own, strict=True)
    return {column if name == UNNAMED else name: column for name, column in pairs}


def without_header(columns: Mapping[str, Sequence[str]]) -> FileFormatError | None:
    """Why columns of tables, by file, say nothing; None where they have names."""
    bare = {
        file: own for file, own in columns.items() if own and all(map(_NUMBERED.fullmatch, own))
    }
    if not bare:
        return None
    several = len(bare) > 1
    has = "have no headers" if several else "has no header"
    counts = " + ".join(str(len(own)) for own in bare.values())
    return FileFormatError(
        f"{', '.join(bare)} {has}, so nothing says what {'their' if several else 'its'} {counts} "
        "columns hold",
        advice="name them in their order"
        + (", file after file" if several else "")
        + ", such as --columns t,q1..q6,tau1..tau6 (- for one that is not needed), or "
        + (
            "column_1, column_2 … of each file under columns of an experiment file"
            if several
            else 'column_names = ["t", "q1", …] under [recording] of an experiment file'
        ),
    )


def written_out(names: Iterable[str]) -> list[str]:
    """Names with those of ranges written out: ``q1..q3`` is q1, q2, q3.

    Raises:
        RecordingError: a range whose ends differ in more than a number that grows.
    """
    found = []
    for name in names:
        match = _RANGE.fullmatch(name)
        if match is None:
            found.append(name)
            continue
        first, low, last, high = match.groups()
        if last not in (first, "") or int(low) > int(high) or int(high) - int(low) > 1000:
            raise RecordingError(
                f"{name!r} is no range of columns",
                advice="it has the form q1..q7, from the lower number on",
            )
        found += [f"{first}{k}" for k in range(int(low), int(high) + 1)]
    return found
