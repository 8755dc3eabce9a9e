"""Tables as plain text."""

from __future__ import annotations

from collections.abc import Sequence

_GAP = "  "


def plain_table(columns: Sequence[tuple[str, str, Sequence[str]]]) -> str:
    """Columns (title, alignment ``<``, ``>`` or ``.`` for decimal points, cells) side by side."""
    padded = []
    for title, align, cells in columns:
        body = _on_decimal_point(cells) if align == "." else list(cells)
        width = max(map(len, [title, *body]))
        side = "<" if align == "<" else ">"
        padded.append([f"{cell:{side}{width}}" for cell in [title, *body]])
    return "\n".join(_GAP.join(cells).rstrip() for cells in zip(*padded, strict=True))


def _on_decimal_point(cells: Sequence[str]) -> list[str]:
    """Numbers padded on the right so that their decimal points are aligned."""
    tails = [len(cell) - cell.find(".") if "." in cell else 0 for cell in cells]
    widest = max(tails, default=0)
    return [cell + " " * (widest - tail) for cell, tail in zip(cells, tails, strict=True)]
