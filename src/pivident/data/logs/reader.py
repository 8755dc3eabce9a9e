"""What a kind of file must offer so that its logs are read: names first, then the arrays."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np


@dataclass(frozen=True)
class Reader:
    """One kind of file.

    Its functions take the path of a file that exists and has content. Each raises a
    `pivident.foundation.errors.FileFormatError` that names the file where it is damaged, or a
    `pivident.foundation.errors.BadCell` where a sample is no number.

    Attributes:
        endings: of the names of its files, in small letters: ``(".csv", ".txt")``.
        names: names of the columns or arrays of a file, without loading them.
        read: columns or arrays by name; all of them, or those that are named. Those of one
            recorder have shape (samples,), or the samples along one axis.
        unread: why a file holds more than `names` lists, by the name of what is passed over.
        forgiving: all columns that hold numbers, NaN where a cell is empty or no number; only for
            files whose cells may be anything.
        packed: endings behind the others of compressed files that it unpacks: ``(".gz",)``.
        is_text: whether its files are text; a text file with another ending is refused.
    """

    endings: tuple[str, ...]
    names: Callable[[Path], tuple[str, ...]]
    read: Callable[[Path, Sequence[str] | None], dict[str, np.ndarray]]
    unread: Callable[[Path], dict[str, str]] = field(default=lambda path: {})
    forgiving: Callable[[Path], dict[str, np.ndarray]] | None = None
    packed: tuple[str, ...] = ()
    is_text: bool = False

    def takes(self, name: str) -> bool:
        """Whether a file of this name is read, packed or not."""
        name = name.lower()
        for ending in self.packed:
            name = name.removesuffix(ending)
        return Path(name).suffix in self.endings
