"""Parquet tables.

They are read by pyarrow, which turns pages that lie into errors. The reader of Polars ends the
whole process at some of them.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from pivident.errors import BadCell, FileFormatError
from pivident.extras import require
from pivident.logs.source_files import existing_file, refuse_bomb
from pivident.scratch import working_array

if TYPE_CHECKING:
    from pyarrow.parquet import ParquetFile

#: Rows that are read at a time; a longer table is never held in memory.
ROWS = 2**20

#: Largest text [bytes] and longest list in the description of a table.
MAX_TEXT, MAX_LIST = 10_000_000, 1_000_000


def parquet_names(path: str | Path) -> tuple[str, ...]:
    """Names of the numeric columns, without loading them."""
    path = existing_file(path)
    with _opened(path, "is not a readable Parquet file") as table:
        from pyarrow import types

        tests = (types.is_integer, types.is_floating, types.is_boolean, types.is_decimal)
        columns = table.schema_arrow
        return tuple(c.name for c in columns if any(test(c.type) for test in tests))


def read_parquet(path: str | Path, names: Sequence[str] | None = None) -> dict[str, np.ndarray]:
    """Columns of a Parquet table, each of shape (samples,)."""
    path = existing_file(path)
    wanted = list(parquet_names(path) if names is None else names)
    with _opened(path, "is a damaged Parquet file") as table:
        rows = table.metadata.num_rows
        refuse_bomb(path, 8 * len(wanted) * rows)
        columns = working_array((len(wanted), rows))
        first = 0
        for batch in table.iter_batches(ROWS, columns=wanted):
            last = first + batch.num_rows
            if last > rows:
                break
            for name, column in zip(wanted, columns, strict=True):
                cells = batch.column(batch.schema.names.index(name))
                if cells.null_count:
                    row = first + int(np.argmax(cells.is_null().to_numpy(False))) + 1
                    raise BadCell(path.name, row, name, "", "the cell is empty")
                column[first:last] = cells.cast("float64", safe=False).to_numpy(False)
            first = last
        if first != rows:
            raise OSError(f"it promises {rows} rows and has others")
    return dict(zip(wanted, columns, strict=True))


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
