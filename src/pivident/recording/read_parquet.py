"""Parquet tables."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from pivident.errors import BadCell, FileFormatError
from pivident.recording.files import existing_file, nameable, refuse_bomb
from pivident.scratch import working_array

#: Rows that are read at a time; a longer table is never held in memory.
ROWS = 2**20


def parquet_names(path: str | Path) -> tuple[str, ...]:
    """Names of the numeric columns, without loading them.

    Raises:
        FileFormatError: the file is missing, empty or no Parquet file.
    """
    import polars as pl

    path = existing_file(path)
    try:
        schema = pl.read_parquet_schema(nameable(path))
    except (pl.exceptions.PolarsError, pl.exceptions.PanicException, OSError) as error:
        raise FileFormatError(f"{path.name} is not a readable Parquet file ({error})") from error
    return tuple(name for name, kind in schema.items() if kind.is_numeric() or kind == pl.Boolean)


def read_parquet(path: str | Path, names: Sequence[str] | None = None) -> dict[str, np.ndarray]:
    """Columns of a Parquet table.

    Args:
        path: the file.
        names: the columns wanted, which are in the file; all numeric ones where it is not given.

    Returns:
        Each column by its name, shape (samples,), float64.

    Raises:
        FileFormatError: the file is missing, damaged or expands beyond reason.
        BadCell: a wanted cell is empty.
    """
    import polars as pl

    path = existing_file(path)
    wanted = list(parquet_names(path) if names is None else names)
    try:
        table = pl.scan_parquet(nameable(path), glob=False)
        rows = table.select(pl.len()).collect().item()
        refuse_bomb(path, 8 * len(wanted) * rows)
        columns = working_array((len(wanted), rows))
        for first in range(0, rows, ROWS):
            part = table.slice(first, ROWS).select(pl.col(wanted).cast(pl.Float64)).collect()
            for name, column in zip(wanted, columns, strict=True):
                empty = part[name].is_null().arg_true()
                if len(empty):
                    row = first + int(empty[0]) + 1
                    raise BadCell(path.name, row, name, "", "the cell is empty")
                column[first : first + ROWS] = part[name].to_numpy()
    except (pl.exceptions.PolarsError, pl.exceptions.PanicException, OSError) as error:
        raise FileFormatError(f"{path.name} is a damaged Parquet file ({error})") from error
    return dict(zip(wanted, columns, strict=True))
