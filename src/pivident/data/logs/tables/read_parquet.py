"""Parquet tables: columns of numbers, and of lists and structures of numbers.

A list with the same number of entries in every row gives ``action[0]``, ``action[1]`` …, or
``action.left_elbow`` where LeRobot's ``meta/info.json`` beside the table names them; a structure
gives ``state.q``. Tables are read by pyarrow, which turns pages that lie into errors. The reader of
Polars ends the whole process at some of them.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pivident.data.logs.reader import Reader
from pivident.data.logs.source_files import refuse_bomb
from pivident.foundation.errors import BadCell, FileFormatError
from pivident.foundation.extras import require
from pivident.foundation.scratch import working_array

if TYPE_CHECKING:
    from pyarrow.parquet import ParquetFile

#: Rows that are read at a time; a longer table is never held in memory.
ROWS = 2**20

#: Largest text [bytes] and longest list in the description of a table.
MAX_TEXT, MAX_LIST = 10_000_000, 1_000_000

#: Most entries of the lists of a column, and levels of structures inside each other.
MAX_LENGTH, MAX_LEVELS = 1000, 8


@dataclass(frozen=True)
class _Column:
    """Numbers of a table: those of a column, a field of a structure, or a place in lists."""

    fields: tuple[str, ...]  # name of the column, and of fields of structures in it
    length: int = 0  # entries of its lists, 0 for single numbers
    place: int = 0  # in the lists


def parquet_names(path: Path) -> tuple[str, ...]:
    """Names of the columns of numbers, without loading them."""
    with _opened(path, "is not a readable Parquet file") as table:
        return tuple(_columns(path, table)[0])


def parquet_unread(path: Path) -> dict[str, str]:
    """Why the other columns are not read, by their names."""
    with _opened(path, "is not a readable Parquet file") as table:
        return _columns(path, table)[1]


def read_parquet(path: Path, names: Sequence[str] | None = None) -> dict[str, np.ndarray]:
    """Columns of a Parquet table, each of shape (samples,)."""
    with _opened(path, "is a damaged Parquet file") as table:
        known = _columns(path, table)[0]
        wanted = {name: known[name] for name in (known if names is None else names)}
        rows = table.metadata.num_rows
        refuse_bomb(path, 8 * len(wanted) * rows)
        columns = working_array((len(wanted), rows))
        first = 0
        for batch in table.iter_batches(
            ROWS, columns=sorted({c.fields[0] for c in wanted.values()})
        ):
            last = first + batch.num_rows
            if last > rows:
                break
            cells: dict[tuple[str, ...], np.ndarray] = {}
            for (name, own), column in zip(wanted.items(), columns, strict=True):
                if own.fields not in cells:
                    cells[own.fields] = _numbers(path, name, own, batch, first)
                column[first:last] = cells[own.fields][:, own.place]
            first = last
        if first != rows:
            raise OSError(f"it promises {rows} rows and has others")
    return dict(zip(wanted, columns, strict=True))


def _columns(path: Path, table: ParquetFile) -> tuple[dict[str, _Column], dict[str, str]]:
    """The columns of numbers by name, and why others are none."""
    from pyarrow import types

    numeric = (types.is_integer, types.is_floating, types.is_boolean, types.is_decimal)
    lists = (types.is_list, types.is_large_list, types.is_fixed_size_list)
    found: dict[str, _Column] = {}
    unread: dict[str, str] = {}

    def add(field: Any, above: tuple[str, ...]) -> None:
        fields, kind = (*above, field.name), field.type
        name = ".".join(fields)
        if any(test(kind) for test in numeric):
            found[name] = _Column(fields)
        elif types.is_struct(kind) and len(fields) < MAX_LEVELS:
            for inner in kind:
                add(inner, fields)
        elif any(test(kind) for test in lists) and any(test(kind.value_type) for test in numeric):
            low, high = _lengths(path, table, fields, kind)
            if low == high and 0 < high <= MAX_LENGTH:
                for place, label in enumerate(_labels(path, name, high)):
                    found[f"{name}{label}"] = _Column(fields, high, place)
            else:
                unread[name] = f"lists of {low} to {high} numbers"
        else:
            unread[name] = f"of type {str(kind)[:60]}"

    for field in table.schema_arrow:
        add(field, ())
    return found, unread


def _lengths(path: Path, table: ParquetFile, fields: tuple[str, ...], kind: Any) -> tuple[int, int]:
    """Length of the shortest and of the longest list of a column, 0 where one is missing."""
    from pyarrow import compute, types

    if types.is_fixed_size_list(kind):
        return kind.list_size, kind.list_size
    # A damaged description of a chunk ends the process where it is asked for; scanned, it raises.
    table.scan_contents([fields[0]])
    within = f"{'.'.join(fields)}."
    leaves = [j for j in range(len(table.schema)) if table.schema.column(j).path.startswith(within)]
    groups = (table.metadata.row_group(k) for k in range(table.metadata.num_row_groups))
    refuse_bomb(path, 8 * sum(group.column(j).num_values for group in groups for j in leaves))
    low, high = MAX_LENGTH + 1, 0
    for batch in table.iter_batches(ROWS, columns=[fields[0]]):
        lengths = compute.list_value_length(_cells(batch, fields)).fill_null(0)
        if len(lengths):
            ends = compute.min_max(lengths)
            low, high = min(low, ends["min"].as_py()), max(high, ends["max"].as_py())
    return min(low, high), high


def _cells(batch: Any, fields: tuple[str, ...]) -> Any:
    """A column of a batch, or a field of the structures in it."""
    cells = batch.column(batch.schema.names.index(fields[0]))
    for name in fields[1:]:
        names = [field.name for field in cells.type]
        cells = cells.flatten()[names.index(name)]
    return cells


def _numbers(path: Path, name: str, column: _Column, batch: Any, first: int) -> np.ndarray:
    """Numbers of a batch, shape (rows, entries); ``first``: rows of the table before it."""
    cells = _cells(batch, column.fields)
    if cells.null_count:
        row = first + int(np.argmax(cells.is_null().to_numpy(False))) + 1
        raise BadCell(path.name, row, name, "", "the cell is empty")
    width = max(column.length, 1)
    cells = cells.flatten() if column.length else cells
    if cells.null_count:
        row = first + int(np.argmax(cells.is_null().to_numpy(False))) // width + 1
        raise BadCell(path.name, row, name, "", "an entry of the list is empty")
    return cells.cast("float64", safe=False).to_numpy(False).reshape(batch.num_rows, width)


def _labels(path: Path, column: str, length: int) -> list[str]:
    """What stands behind the name of a column of lists: names of LeRobot, or numbers."""
    names: list[str] = []
    for folder in path.absolute().parents[:3]:
        info = folder / "meta" / "info.json"
        if not info.is_file() or info.stat().st_size > MAX_TEXT:
            continue
        with suppress(ValueError, OSError, LookupError, TypeError, RecursionError):
            _collect(json.loads(info.read_text("utf-8"))["features"][column]["names"], names)
        break
    if len(set(names)) == length == len(names):
        return [f".{name}" for name in names]
    return [f"[{k}]" for k in range(length)]


def _collect(entry: Any, names: list[str]) -> None:
    """The texts in lists of lists, or in the lists of a table."""
    if isinstance(entry, str):
        names.append(entry)
        return
    for inner in entry.values() if isinstance(entry, dict) else entry or ():
        _collect(inner, names)


@contextmanager
def _opened(path: Path, problem: str) -> Iterator[ParquetFile]:
    """The table of a file; what is wrong with it ends as one error that says so."""
    pyarrow = require("pyarrow", extra="parquet", purpose=path.name)
    parquet = require("pyarrow.parquet", extra="parquet", purpose=path.name)
    try:
        with (
            path.open("rb") as stream,
            parquet.ParquetFile(
                stream,
                pre_buffer=False,
                thrift_string_size_limit=MAX_TEXT,
                thrift_container_size_limit=MAX_LIST,
            ) as table,
        ):
            yield table
    except (BadCell, FileFormatError):
        raise
    except (pyarrow.ArrowException, OSError, ValueError) as error:
        reason = str(error).partition("\n")[0]
        raise FileFormatError(f"{path.name} {problem} ({reason})") from error


#: The reader of Parquet tables.
PARQUET = Reader((".parquet",), parquet_names, read_parquet, parquet_unread)
