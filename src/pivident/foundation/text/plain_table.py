"""Tables as plain text."""

from __future__ import annotations

from collections.abc import Sequence

#: Between two columns.
GAP = "  "


def plain_table(columns: Sequence[tuple[str, str, Sequence[str]]]) -> str:
    """Columns (title, alignment ``<``, ``>`` or ``.`` for decimal points, cells) side by side."""
    return lines_of([column(title, cells, align) for title, align, cells in columns])


def column(title: str, cells: Sequence[str], align: str, top: str | None = None) -> list[str]:
    """Head and cells padded to one width; ``align`` is <, > or . for the decimal points."""
    body = _on_decimal_point(cells) if align == "." else list(cells)
    head = [title] if top is None else [top, title]
    width = max(map(len, head + body))
    side = "<" if align == "<" else ">"
    return [f"{cell:{side}{width}}" for cell in head + body]


def lines_of(columns: Sequence[Sequence[str]]) -> str:
    """Columns of equal height side by side, as lines."""
    return "\n".join(GAP.join(cells).rstrip() for cells in zip(*columns, strict=True))


def _on_decimal_point(cells: Sequence[str]) -> list[str]:
    """Numbers padded on the right so that their decimal points are aligned."""
    tails = [len(cell) - cell.find(".") if "." in cell else 0 for cell in cells]
    widest = max(tails, default=0)
    return [cell + " " * (widest - tail) for cell, tail in zip(cells, tails, strict=True)]
