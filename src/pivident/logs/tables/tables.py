"""One way to read every kind of file: names first, then only the arrays that are needed."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from itertools import islice
from pathlib import Path

import numpy as np

from pivident.errors import FileFormatError, UnknownColumn
from pivident.logs.bags.read_bag import bag_names, is_bag, open_bag, read_bag
from pivident.logs.source_files import existing_file
from pivident.logs.tables.read_csv import csv_names, read_csv
from pivident.logs.tables.read_mat import mat_names, mat_unread, read_mat
from pivident.logs.tables.read_npz import npy_names, npz_names, read_npy, read_npz
from pivident.logs.tables.read_parquet import parquet_names, parquet_unread, read_parquet
from pivident.robot.naming import near_names
from pivident.text.printable import is_printable

#: Longest name of a column or an array, in characters.
MAX_NAME = 500

#: Endings of spreadsheets, which are not read.
SPREADSHEETS = (".xlsx", ".xls", ".xlsm", ".ods")

Names = Callable[[Path], tuple[str, ...]]
Read = Callable[[Path, Sequence[str] | None], dict[str, np.ndarray]]

READERS: dict[str, tuple[Names, Read]] = {
    ".csv": (csv_names, read_csv),
    ".txt": (csv_names, read_csv),
    ".tsv": (csv_names, read_csv),
    ".npz": (npz_names, read_npz),
    ".npy": (npy_names, read_npy),
    ".mat": (mat_names, read_mat),
    ".parquet": (parquet_names, read_parquet),
    ".bag": (bag_names, read_bag),
    ".db3": (bag_names, read_bag),
    ".mcap": (bag_names, read_bag),
}

#: What tells why a kind of file holds something that its reader passes over.
UNREAD: dict[Names, Callable[[Path], dict[str, str]]] = {
    mat_names: mat_unread, parquet_names: parquet_unread,
}  # fmt: skip

#: Files that a message about a folder names, levels of folders in which they are looked for, and
#: entries of a level that are looked at.
MAX_FILES, FOLDERS, MAX_ENTRIES = 3, 3, 10_000


def names_in(path: str | Path) -> tuple[str, ...]:
    """Names of the columns or arrays in a file, without loading them."""
    path = Path(path)
    reader = _reader(path)[0]
    if reader is not csv_names and os.path.isfile(path):
        _refuse_text(path)
    names = reader(path)
    for name in names:
        if len(name) > MAX_NAME or not is_printable(name):
            what = "control characters" if len(name) <= MAX_NAME else f"{len(name)} characters"
            raise FileFormatError(
                f"{path.name} has a column or array whose name has {what}, "
                f"{name[:20]!r}…; rename it"
            )
    return names


def read_table(path: str | Path, names: Sequence[str] | None = None) -> dict[str, np.ndarray]:
    """Columns or arrays of a file by name."""
    path = Path(path)
    known = names_in(path)
    for name in names or ():
        if name not in known:
            raise UnknownColumn(path.name, name, near_names(name, known), known)
    return _reader(path)[1](path, names)


def unread_in(path: str | Path) -> dict[str, str]:
    """What a file holds beside the columns and arrays that can be read: why not, by name."""
    path = Path(path)
    if is_bag(path):
        return open_bag(path).passed_over
    told = UNREAD.get(_reader(path)[0])
    return {} if told is None else told(path)


def _refuse_text(path: Path) -> None:
    """Refuse a table of text whose ending promises another kind of file."""
    with existing_file(path).open("rb") as stream:
        beginning = stream.read(1024)
    if len(beginning) > 16 and all(byte in b"\t\r\n" or 32 <= byte < 127 for byte in beginning):
        raise FileFormatError(
            f"{path.name} is text, not a {path.suffix} file; give it the ending .csv, or export "
            "it again"
        )


def _folder(path: Path) -> str:
    """What to do about a folder that is no bag: the logs in it, or a pattern for them."""
    found: list[Path] = []
    for level in range(1, FOLDERS + 1):
        inside = sorted(islice(path.glob("/".join("*" * level)), MAX_ENTRIES))
        found += [f for f in inside if f.suffix.lower() in READERS and f.suffix != ".txt"]
        if found:
            break
    names = [f.relative_to(path.parent).as_posix() for f in found]
    pattern = f"{names[0].rpartition('/')[0]}/*{found[0].suffix}" if found else f"{path.name}/*.csv"
    more = " …" if len(names) > MAX_FILES else ""
    listed = f" ({', '.join(names[:MAX_FILES])}{more})" if found else ""
    return (
        f"{path.name} is a folder; name the file with the record in it{listed}, or a pattern such "
        f'as "{pattern}" for all of its runs'
    )


def _reader(path: Path) -> tuple[Names, Read]:
    """The two functions for a kind of file, by its name."""
    if is_bag(path):
        return bag_names, read_bag
    if os.path.isdir(path):  # takes any name
        raise FileFormatError(_folder(path))
    name = path.name.lower()
    suffix = Path(name.removesuffix(".gz")).suffix
    text_only = name.endswith(".gz")
    if suffix in SPREADSHEETS:
        raise FileFormatError(
            f"{path.name}: no reader for this kind of file, the workbook of a spreadsheet program; "
            "export its sheet as CSV"
        )
    if suffix in (".urdf", ".xacro"):
        raise FileFormatError(
            f"{path.name} is a robot description, not a log; name the log, and the robot as "
            f"--robot {path.name}"
        )
    if suffix not in READERS or (text_only and READERS[suffix][1] is not read_csv):
        raise FileFormatError(
            f"{path.name}: no reader for this kind of file; "
            f"use one of {', '.join(READERS)} or a gzipped text table"
        )
    return READERS[suffix]
