"""A table: columns of equal length, each declared once for terminal, page, file and frame."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from os import PathLike
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from pivident.foundation.errors import PividentError, UnknownName
from pivident.foundation.extras import require
from pivident.foundation.text.display import Displayed
from pivident.foundation.text.identifiers import escaped, latex_text, one_line, sheet_text
from pivident.foundation.text.numbers import (
    format_significant,
    latex_number,
    latex_unit,
    plain_table,
    with_spread,
)
from pivident.foundation.text.plain_values import csv_table

if TYPE_CHECKING:
    import pandas as pd
    import polars as pl

Values = np.ndarray | Sequence[Any]

#: A column for the eye: title, alignment ``<`` or ``.`` for decimal points, its first cells.
Shown = tuple[str, str, list[str]]

#: Rows and characters of a cell that are printed.
_MAX_ROWS, _MAX_CELL = 20, 40


class TableError(PividentError, ValueError):
    """A table that does not exist."""


@dataclass(frozen=True, eq=False)
class Column:
    """Values of one kind, and how they are shown.

    Attributes:
        values: one for each row; NaN for a number, None for anything else that is not known.
        title: heading for the eye; empty: the name of the column.
        shown: where it is shown: everywhere, on pages only, or in files and frames only.
        spread: half width of the interval of each value, which is then rounded to two digits of it
            and followed by a column of its own.
        spread_title: heading of that column.
        digits: significant digits that are shown, beside a spread those of values without one;
            None: the value's own, at most six.
        file_format: of its numbers in a file, such as ``%.10g``; empty: all digits.
        cells: what is shown in place of the values.
        align: ``<``, ``>`` or ``.`` for decimal points; empty: by the values.
    """

    values: Values
    title: str = ""
    shown: Literal["everywhere", "pages", "files"] = "everywhere"
    spread: np.ndarray | None = None
    spread_title: str = "± 95 %"
    digits: int | None = None
    file_format: str = ""
    cells: Sequence[str] | None = None
    align: str = ""

    @property
    def series(self) -> Any:
        """The values as an array or a list, which libraries of frames take."""
        return self.values if isinstance(self.values, np.ndarray) else list(self.values)

    def texts(self, name: str, most: int | None) -> list[Shown]:
        """The first rows as they are shown, beside those of the spread."""
        head, title = _plain(self.values[:most]), self.title or name
        if self.spread is not None:
            pairs = zip(head, self.spread[:most].tolist(), strict=True)
            texts = [
                with_spread(x, half)
                if self.digits is None or np.isfinite(half)
                else (format_significant(x, self.digits), "–")
                for x, half in pairs
            ]
            titles = title, self.spread_title
            return [(titles[k], ".", [text[k] for text in texts]) for k in (0, 1)]
        is_number = any(isinstance(x, float | int) and not isinstance(x, bool) for x in head)
        if self.cells is not None:
            cells = list(self.cells[:most])
        elif self.digits is not None:
            cells = [format_significant(x, self.digits) for x in head]
        else:
            cells = [_text(x, None if most is None else _MAX_CELL) for x in head]
        return [(title, self.align or ("." if is_number else "<"), cells)]

    def written(self) -> list[Any]:
        """The values in a file: what is not known is empty, no text is a formula of a sheet."""
        form, values = self.file_format, _plain(self.values)
        are_floats = isinstance(self.values, np.ndarray) and self.values.dtype.kind == "f"
        if form and values and are_floats and np.isfinite(self.values).all():
            return ("\n".join([form] * len(values)) % tuple(values)).split("\n")  # all in one go
        return [
            ""
            if value is None or (isinstance(value, float) and not np.isfinite(value))
            else form % value
            if form
            else sheet_text(value)
            if isinstance(value, str)
            else value
            for value in values
        ]


@dataclass(frozen=True, eq=False)
class Table(Displayed):
    """Columns of equal length.

    Numbers that are not known are NaN, other entries None.

    Attributes:
        name: what it is a table of, such as ``parameters``.
        columns: by name, in order; values alone are columns shown by their name.
        meanings: what the columns mean where their name does not say it.
        title: what it shows, for those who do not see it and over it in notebooks; empty: its name.
    """

    name: str
    columns: Mapping[str, Column | Values]
    meanings: Mapping[str, str] = field(default_factory=dict)
    title: str = ""

    def __post_init__(self) -> None:
        lengths = {len(column.values) for column in self._columns.values()}
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
        columns = {key: column_of([row[key] for row in rows]) for key in names}
        return cls(name, columns, meanings or {})

    @property
    def _columns(self) -> dict[str, Column]:
        items = self.columns.items()
        return {name: own if isinstance(own, Column) else Column(own) for name, own in items}

    def __len__(self) -> int:
        return len(next(iter(self._columns.values()), Column(())).values)

    def __getitem__(self, column: str) -> Values:
        if column not in self.columns:
            there = f"there are {', '.join(self.columns)}"
            raise UnknownName(f"no column {column!r}", advice=there)
        return self._columns[column].values

    def rows(self) -> list[dict[str, Any]]:
        """The rows as dictionaries of plain values."""
        rows = zip(*(_plain(column.values) for column in self._columns.values()), strict=True)
        return [dict(zip(self.columns, row, strict=True)) for row in rows]

    def to_polars(self) -> pl.DataFrame:
        """The table as a polars frame.

        Raises:
            MissingExtra: polars is not installed.
        """
        pl = require("polars", extra="tables", purpose="to_polars()")
        return pl.DataFrame({name: own.series for name, own in self._columns.items()})

    def to_pandas(self) -> pd.DataFrame:
        """The table as a pandas frame.

        Raises:
            MissingExtra: pandas is not installed.
        """
        pd = require("pandas", extra="pandas", purpose="to_pandas()")
        return pd.DataFrame({name: own.series for name, own in self._columns.items()})

    def to_csv(self, path: str | PathLike[str] | None = None) -> str:
        """The table as CSV text, written to a file where one is named.

        Numbers that are not known are left empty. Text that a sheet would take for a formula gets
        an apostrophe in front.

        Args:
            path: file to write; None: none.

        Raises:
            PividentError: the file cannot be written.
        """
        columns = [column.written() for column in self._columns.values()]
        text = csv_table(self.columns, zip(*columns, strict=True))
        if path is not None:
            from pivident.foundation.files import write_file

            write_file(path, text, errors="backslashreplace")
        return text

    def to_latex(self, comment: str = "") -> str:
        """The table for LaTeX, with the rules of booktabs; all external text is escaped.

        Args:
            comment: a line in front; empty: the title.
        """
        shown = [part for name, own in self._columns.items() for part in own.texts(name, None)]
        written = [
            [latex_unit(x) for x in cells]
            if title == "unit"
            else [latex_number(x) if align == "." else latex_text(one_line(x)) for x in cells]
            for title, align, cells in shown
        ]
        rows = zip(*written, strict=True)
        heads = [latex_text(one_line(title)) for title, _, _ in shown]
        return "\n".join(
            [
                f"% {one_line(comment or self.title or self.name)}",
                r"% In the preamble: \usepackage{amsmath,booktabs}",
                rf"\begin{{tabular}}{{{''.join('r' if a == '.' else 'l' for _, a, _ in shown)}}}",
                r"\toprule",
                " & ".join(heads) + r" \\",
                r"\midrule",
                *(" & ".join(row) + r" \\" for row in rows),
                r"\bottomrule",
                r"\end{tabular}",
                "",
            ]
        )

    def __repr__(self) -> str:
        return f"<Table {self.name}: {len(self)} rows, columns {', '.join(self.columns)}>"

    def __str__(self) -> str:
        more = len(self) - _MAX_ROWS
        text = self.text(_MAX_ROWS)
        return f"{text}\n… and {more} more rows" if more > 0 else text

    def text(self, most: int | None = None) -> str:
        """The table as plain text.

        Args:
            most: rows that are shown; None: all.
        """
        return plain_table(self.shown(most))

    def shown(self, most: int | None = None, *, page: bool = False) -> list[Shown]:
        """The columns for the eye.

        Args:
            most: rows that are shown; None: all.
            page: whether there is room for the columns of pages.
        """
        places = ("everywhere", "pages") if page else ("everywhere",)
        columns = [(name, own) for name, own in self._columns.items() if own.shown in places]
        return [part for name, own in columns for part in own.texts(name, most)]


def column_of(values: list[Any]) -> Values:
    """Numbers as an array, with NaN for None; anything else as it is."""
    kinds = {type(v) for v in values if v is not None}
    if kinds and kinds <= {float, int, np.float64, np.float32} and kinds != {int}:
        return np.array([np.nan if v is None else v for v in values], dtype=float)
    if kinds == {int} and None not in values:
        return np.array(values, dtype=np.int64)
    return tuple(values)


def _plain(values: Values) -> list[Any]:
    return values.tolist() if isinstance(values, np.ndarray) else list(values)


def _text(value: Any, most: int | None) -> str:
    """One cell for the eye, of so many characters."""
    if value is None:
        return "–"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return "–" if np.isnan(value) else f"{value:.6g}"
    text = escaped(" ".join(str(value).split()))
    return text if most is None or len(text) <= most else f"{text[: most - 1]}…"
