"""A table: named columns of equal length, and what they mean."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pivident.errors import PividentError
from pivident.extras import require
from pivident.text.display import Displayed
from pivident.text.plain_values import csv_table
from pivident.text.printable import sheet_text

if TYPE_CHECKING:
    import pandas as pd
    import polars as pl

Values = np.ndarray | Sequence[Any]

#: Rows and characters of a cell that are printed.
_MAX_ROWS, _MAX_CELL = 20, 40


class TableError(PividentError, ValueError):
    """A table that does not exist."""


@dataclass(frozen=True, eq=False)
class Table(Displayed):
    """Columns of equal length.

    Numbers that are not known are NaN, other entries None.

    Attributes:
        name: what it is a table of, such as ``parameters``.
        columns: values by name, in order.
        meanings: what the columns mean where their name does not say it.
    """

    name: str
    columns: Mapping[str, Values]
    meanings: Mapping[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        lengths = {len(values) for values in self.columns.values()}
        if len(lengths) > 1:
            raise TableError(
                f"the columns of the table {self.name!r} have {sorted(lengths)} rows",
                advice="give each column the same length",
            )

    @classmethod
    def of_rows(
        cls,
        name: str,
        rows: Iterable[Mapping[str, Any]],
        meanings: Mapping[str, str] | None = None,
        empty: Sequence[str] = (),
    ) -> Table:
        """A table of rows that all have the same entries.

        Args:
            name: what it is a table of.
            rows: entries by column.
            meanings: of the columns.
            empty: names of the columns where there are no rows.

        Returns:
            The table.
        """
        rows = list(rows)
        names = list(rows[0]) if rows else list(empty)
        columns = {key: _column([row[key] for row in rows]) for key in names}
        return cls(name, columns, meanings or {})

    def __len__(self) -> int:
        return len(next(iter(self.columns.values()), ()))

    def __getitem__(self, column: str) -> Values:
        if column not in self.columns:
            raise KeyError(f"no column {column!r}; there are {', '.join(self.columns)}")
        return self.columns[column]

    def rows(self) -> list[dict[str, Any]]:
        """The rows as dictionaries of plain values."""
        lists = [v.tolist() if isinstance(v, np.ndarray) else v for v in self.columns.values()]
        return [dict(zip(self.columns, row, strict=True)) for row in zip(*lists, strict=True)]

    def to_polars(self) -> pl.DataFrame:
        """The table as a polars frame.

        Raises:
            MissingExtra: polars is not installed.
        """
        pl = require("polars", extra="tables", purpose="to_polars()")
        return pl.DataFrame({name: _series(values) for name, values in self.columns.items()})

    def to_pandas(self) -> pd.DataFrame:
        """The table as a pandas frame.

        Raises:
            MissingExtra: pandas is not installed.
        """
        pd = require("pandas", extra="pandas", purpose="to_pandas()")
        return pd.DataFrame({name: _series(values) for name, values in self.columns.items()})

    def to_csv(self, path: str | PathLike[str] | None = None) -> str:
        """The table as CSV text, written to a file where one is named.

        Numbers that are not known are left empty. Text that a sheet would take for a formula gets
        an apostrophe in front.

        Args:
            path: file to write; None: none.

        Raises:
            PividentError: the file cannot be written.
        """
        text = csv_table(self.columns, ([_cell(v) for v in r.values()] for r in self.rows()))
        if path is not None:
            from pivident.files import atomic_folder

            target = Path(path)
            with atomic_folder(target.parent) as build:
                (build / target.name).write_text(text, "utf-8", errors="backslashreplace")
        return text

    def __repr__(self) -> str:
        return f"<Table {self.name}: {len(self)} rows, columns {', '.join(self.columns)}>"

    def __str__(self) -> str:
        from pivident.text.plain_table import plain_table

        shown = self.shown(_MAX_ROWS)
        text = plain_table([(name, "." if number else "<", cells) for name, number, cells in shown])
        more = len(self) - _MAX_ROWS
        return f"{text}\n… and {more} more rows" if more > 0 else text

    def shown(self, most: int) -> list[tuple[str, bool, list[str]]]:
        """Name of each column, whether it holds numbers, and its first cells as text.

        Args:
            most: rows that are shown.
        """
        columns = []
        for name, values in self.columns.items():
            head = values[:most]
            plain = head.tolist() if isinstance(head, np.ndarray) else list(head)
            number = any(isinstance(v, float | int) and not isinstance(v, bool) for v in plain)
            columns.append((name, number, [_text(value) for value in plain]))
        return columns


def _column(values: list[Any]) -> Values:
    """Numbers as an array, with NaN for None; anything else as it is."""
    kinds = {type(v) for v in values if v is not None}
    if kinds and kinds <= {float, int, np.float64, np.float32} and kinds != {int}:
        return np.array([np.nan if v is None else v for v in values], dtype=float)
    if kinds == {int} and None not in values:
        return np.array(values, dtype=np.int64)
    return tuple(values)


def _series(values: Values) -> Any:
    return values if isinstance(values, np.ndarray) else list(values)


def _cell(value: Any) -> Any:
    if value is None or (isinstance(value, float) and not np.isfinite(value)):
        return ""
    return sheet_text(value) if isinstance(value, str) else value


def _text(value: Any) -> str:
    """One cell for the eye."""
    from pivident.text.printable import escaped

    if value is None:
        return "–"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return "–" if np.isnan(value) else f"{value:.6g}"
    text = escaped(" ".join(str(value).split()))
    return text if len(text) <= _MAX_CELL else f"{text[: _MAX_CELL - 1]}…"
