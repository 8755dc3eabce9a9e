"""Columns of a file below the checks of a `Recording`: whatever is a number gets in.

The clocks among them are told by name and by their steps, and turned into seconds.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from pivident.errors import BadCell, FileFormatError
from pivident.logs.clocks.timestamps import LIKELY_RATES, LOWEST_RATE
from pivident.logs.recognition.column_names import is_clock
from pivident.logs.tables.read_csv import read_csv_forgiving
from pivident.logs.tables.tables import names_in, read_table
from pivident.logs.units import TIME


def read_columns(path: Path) -> dict[str, np.ndarray]:
    """Every numeric column of a file; arrays of two axes column by column.

    Raises:
        FileFormatError: the file cannot be read, or holds no numbers.
    """
    columns = numeric_columns(numeric_table(path))
    if not columns:
        raise FileFormatError(f"{path.name} holds no columns of numbers; export the log again")
    return columns


def numeric_table(path: Path) -> dict[str, np.ndarray]:
    """Numeric arrays of a file; cells that are no numbers become NaN.

    Raises:
        FileFormatError: the file cannot be read, or none of its arrays.
    """
    try:
        return read_table(path)
    except BadCell:
        return read_csv_forgiving(path)
    except FileFormatError:
        table: dict[str, np.ndarray] = {}
        for name in names_in(path):  # arrays of text stand between those of numbers
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


def clocks_in(
    columns: Mapping[str, np.ndarray], unit: str | None, declared: Sequence[str] = ()
) -> tuple[dict[str, np.ndarray], str, list[str]]:
    """Time columns in seconds, their unit, and a sentence where it was guessed.

    Args:
        columns: by name, each of shape (samples,).
        unit: of the stamps, where it is known; then every column is a clock.
        declared: names of columns that are clocks whatever they look like.
    """
    found = {
        n: np.asarray(v, float)
        for n, v in columns.items()
        if unit or n in declared or is_clock(n, v)
    }
    if not found:
        return {}, unit or "s", []
    factors, notes = {}, []
    for name, values in found.items():
        own = unit if unit and name == next(iter(found)) else _clock_unit(values)
        factors[name] = TIME.get(str(own), 1.0)
        if unit is None and own != "s":
            notes.append(f"The time stamps {name} were taken for {own}.")
    unit = unit or _clock_unit(next(iter(found.values())))
    return {n: v * factors[n] for n, v in found.items()}, unit, notes


def _clock_unit(stamps: np.ndarray) -> str:
    """Seconds, unless only another unit makes a robot's rate of the stamps."""
    steps = np.diff(stamps[np.isfinite(stamps)])
    interval = float(np.median(steps[steps > 0])) if (steps > 0).any() else 0.0
    if not interval > 1.0 / LOWEST_RATE:
        return "s"
    low, high = LIKELY_RATES
    return next((u for u, s in TIME.items() if low <= 1.0 / (interval * s) <= high), "s")
