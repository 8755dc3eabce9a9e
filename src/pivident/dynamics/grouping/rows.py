"""Rows: linear combinations of parameters with coefficients in named constants."""

from __future__ import annotations

from pivident.dynamics.grouping.geometry import Quantity
from pivident.dynamics.grouping.reach import ROUNDING

#: Coefficient by index of the parameter; none is 0.
Row = dict[int, Quantity]

ONE = Quantity.number(1.0)


def times(row: Row, factor: Quantity) -> Row:
    """A multiple of a row; nothing where the factor is zero."""
    return {k: factor * x for k, x in row.items() if factor.value}


def summed(a: Row, b: Row) -> Row:
    """The sum of two rows."""
    return a | {k: a[k] + x if k in a else x for k, x in b.items()}


def reduced(rows: list[Row], order: list[int]) -> dict[int, Row]:
    """Gauss–Jordan elimination: rows by their leading column (a 1), sought in the given order."""
    left = [(row, max(abs(x.value) for x in row.values())) for row in rows if row]
    done: dict[int, Row] = {}
    for column in order:
        best, pick = ROUNDING, None
        for n, (row, scale) in enumerate(left):
            if column in row and abs(row[column].value) > best * scale:
                best, pick = abs(row[column].value) / scale, n
        if pick is None:
            continue
        row, _ = left.pop(pick)
        row = {k: ONE if k == column else x / row[column] for k, x in row.items()}
        left = [(_without(other, column, row), scale) for other, scale in left]
        done = {head: _without(other, column, row) for head, other in done.items()}
        done[column] = row
    return done


def _without(row: Row, column: int, pivot: Row) -> Row:
    """The row less the multiple of the pivot row that clears the column."""
    if column not in row:
        return row
    factor, out = row[column], dict(row)
    del out[column]
    for k, x in pivot.items():
        if k == column:
            continue
        old = out.pop(k, None)
        new = -(factor * x) if old is None else old - factor * x
        if abs(new.value) > ROUNDING * max(abs(old.value) if old else 0.0, abs(factor.value)):
            out[k] = new
    return out
