"""Columns of a file below the checks of a `Recording`: whatever is a number gets in."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from pivident.errors import BadCell, FileFormatError, NoSamples
from pivident.logs.tables.read_csv import read_csv_forgiving
from pivident.logs.tables.tables import names_in, read_table


def read_columns(path: Path) -> dict[str, np.ndarray]:
    """Every numeric column of a file; arrays of two axes column by column."""
    columns = numeric_columns(lenient_table(path))
    if not columns:
        raise FileFormatError(f"{path.name} holds no columns of numbers; export the log again")
    return columns


def lenient_table(path: Path, names: Sequence[str] | None = None) -> dict[str, np.ndarray]:
    """Numeric arrays of a file, NaN where a cell is no number; others are left out."""
    try:
        return read_table(path, names)
    except BadCell as error:
        try:
            table = read_csv_forgiving(path)
        except FileFormatError:  # no table of text
            raise error from None
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
    """One-dimensional columns of a table; those of an array carry its name and their index."""
    columns: dict[str, np.ndarray] = {}
    lengths = [max(v.shape) for v in table.values() if v.ndim in (1, 2) and v.size]
    samples = max(lengths, default=0)
    for name, values in table.items():
        array = np.asarray(values, dtype=float)
        if array.ndim == 2 and array.shape[0] != samples and array.shape[1] == samples:
            array = array.T
        if array.ndim == 2 and array.shape[1] == 1:
            array = array[:, 0]
        if array.ndim == 1 and len(array) == samples:
            columns[name] = array
        elif array.ndim == 2 and len(array) == samples:
            columns |= {f"{name}[:, {j}]": array[:, j] for j in range(array.shape[1])}
    return columns
