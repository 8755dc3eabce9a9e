"""Logs whose lines are pairs of a name and a number: ``time=0.001 q1=0.52 tau1=-3.1``."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from pivident.data.logs.reader import Reader
from pivident.foundation.errors import BadCell


def names(path: Path) -> tuple[str, ...]:
    """Names in the first line."""
    with path.open(encoding="utf-8") as lines:
        return tuple(pair.partition("=")[0] for pair in next(lines).split())


def read(path: Path, wanted: Sequence[str] | None = None) -> dict[str, np.ndarray]:
    """Numbers by name, each of shape (samples,)."""
    columns: dict[str, list[float]] = {name: [] for name in wanted or names(path)}
    for number, line in enumerate(path.read_text("utf-8").splitlines(), start=1):
        cells = dict(pair.split("=", 1) for pair in line.split() if "=" in pair)
        for name, column in columns.items():
            cell = cells.get(name, "")
            try:
                column.append(float(cell))
            except ValueError:
                raise BadCell(path.name, number, name, cell, "it is no number") from None
    return {name: np.array(column) for name, column in columns.items()}


PAIRS = Reader((".pairs",), names, read, is_text=True)
