"""Columns of a file below the checks of a `Recording`: whatever is a number gets in."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pivident.data.logs.recognition.log_clock import is_clock
from pivident.data.logs.tables.tables import names_in, read_table, reader_of, unread_in
from pivident.foundation.errors import BadCell, FileFormatError, NoSamples
from pivident.foundation.text.identifiers import escaped

#: Longest axis from which on an array of other samples is named; shorter ones are constants.
MIN_ARRAY = 10

#: Things beside the columns that a message names.
MAX_NAMED = 6


@dataclass(frozen=True, eq=False)
class FileColumns:
    """Everything that a file holds."""

    columns: dict[str, np.ndarray]  # numeric, shape (samples,)
    constants: dict[str, np.ndarray]  # short arrays of other lengths: gains, ratios
    beside: dict[str, str]  # what else there is, and why it is no column, by name


def file_columns(path: Path) -> FileColumns:
    """The columns of a file, arrays of two axes one by one, and what it holds beside them."""
    table = lenient_table(path)
    columns, beside = numeric_columns(table), unread_in(path)
    beside |= dict.fromkeys((n for n in names_in(path) if n not in table), "no numbers")
    if not columns:
        raise FileFormatError(
            f"{path.name} holds no columns of numbers{beside_text(beside)}",
            advice="export the log again",
        )
    samples, beside = len(next(iter(columns.values()))), beside | beside_columns(table)
    short = {n: v for n, v in table.items() if 0 < v.size and max(v.shape, default=1) < MIN_ARRAY}
    constants = {n: v.ravel() for n, v in short.items() if max(v.shape, default=1) != samples}
    return FileColumns(columns, constants, beside)


def read_columns(path: Path) -> dict[str, np.ndarray]:
    """Every numeric column of a file; arrays of two axes column by column."""
    return file_columns(path).columns


def beside_text(beside: Mapping[str, str]) -> str:
    """What is no column, in brackets; empty where there is nothing."""
    parts = [f"{escaped(name[:60])}: {why}" for name, why in list(beside.items())[:MAX_NAMED]]
    more = f"; {len(beside) - MAX_NAMED} more" if len(beside) > MAX_NAMED else ""
    return f" ({'; '.join(parts)}{more})" if parts else ""


def lenient_table(path: Path, names: Sequence[str] | None = None) -> dict[str, np.ndarray]:
    """Numeric arrays of a file, NaN where a cell is no number; others are left out."""
    try:
        return read_table(path, names)
    except BadCell:
        forgiving = reader_of(path).forgiving
        if forgiving is None:
            raise
        table = forgiving(path)
        return {n: v for n, v in table.items() if names is None or n in names}
    except NoSamples:  # nor has any column
        raise
    except FileFormatError:
        table = {}
        for name in names_in(path) if names is None else names:  # text stands between numbers
            try:
                table |= read_table(path, [name])
            except FileFormatError:
                continue
        if not table:
            raise
        return table


def numeric_columns(table: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """One-dimensional columns of a table; those of an array carry its name and their place in it.

    Samples may run along any axis of an array: ``q[:, 0]`` is a column, ``q[0, :]`` a row.
    """
    samples = _samples(table)
    columns: dict[str, np.ndarray] = {}
    for name, values in table.items():
        array, long = np.asarray(values, dtype=float), [n for n in values.shape if n != 1]
        if max(array.shape, default=0) != samples or len(long) > 2:
            continue
        if array.size == samples:
            columns[name] = array.ravel()
            continue
        axis = array.shape.index(samples)
        for place in np.ndindex(*array.shape[:axis], *array.shape[axis + 1 :]):
            index = [*map(str, place[:axis]), ":", *map(str, place[axis:])]
            columns[f"{name}[{', '.join(index)}]"] = np.moveaxis(array, axis, -1)[place]
    return columns


def beside_columns(table: Mapping[str, np.ndarray]) -> dict[str, str]:
    """What is no column of a table, or may be one along either axis, with the reason, by name."""
    samples, beside = _samples(table), {}
    for name, values in table.items():
        shape = " × ".join(map(str, values.shape))
        if max(values.shape, default=0) != samples and max(values.shape, default=0) >= MIN_ARRAY:
            beside[name] = f"other samples ({shape}, the log has {samples})"
        elif sum(n != 1 for n in values.shape) > 2:
            beside[name] = f"{values.ndim} axes ({shape})"
        elif values.shape.count(samples) > 1 and samples > 1:
            beside[name] = f"square ({shape}), its first axis is taken for that of the samples"
    return beside


def _samples(table: Mapping[str, np.ndarray]) -> int:
    """Number of samples: that of a time column which other arrays share, or of most numbers."""
    numbers: dict[int, int] = {}
    clocks = set()
    for name, values in table.items():
        length = max(values.shape, default=0)
        if values.size == length and is_clock(name, values.ravel()):
            clocks.add(length)
        else:
            numbers[length] = numbers.get(length, 0) + values.size
    lengths = clocks & numbers.keys() or numbers.keys() or clocks
    return max(lengths, key=lambda length: (numbers.get(length, 0), length), default=0)
