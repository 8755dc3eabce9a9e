"""A table in memory in the place of a file: a data frame of any library, or arrays by name."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from os import PathLike
from typing import Any, Protocol

import numpy as np

from pivident.data.logs.source_files import SourceFile
from pivident.foundation.errors import RecordingError, UnknownColumn
from pivident.foundation.text.sentences import near_names


class SupportsColumns(Protocol):
    """A data frame: ``frame[name]`` is a column, ``frame.columns`` has the names."""

    columns: Any

    def __getitem__(self, name: Any, /) -> Any:
        """A column by its name."""
        ...


@dataclass(frozen=True, eq=False)
class Frame:
    """Columns that are had by their names.

    Attributes:
        table: a frame of pandas or polars, a dictionary of arrays, or anything else with
            ``table[name]`` and its names as ``columns`` or ``keys()``.
        name: what messages call it.
    """

    table: Any
    name: str = "the frame"

    @staticmethod
    def is_one(files: Any) -> bool:
        """Whether an argument is a table, rather than a path or several by key."""
        if isinstance(files, Mapping):
            return not all(isinstance(path, str | PathLike) for path in files.values())
        return hasattr(files, "columns") and hasattr(files, "__getitem__")

    @property
    def names(self) -> tuple[str, ...]:
        """Names of its columns."""
        named = self.table.keys() if isinstance(self.table, Mapping) else self.table.columns
        return tuple(map(str, named))

    @property
    def source(self) -> SourceFile:
        """Hash of the bytes of its columns of numbers, in their order."""
        digest = hashlib.sha256()
        for name in self.names:
            values = np.ascontiguousarray(self.table[name])
            if values.dtype.kind in "fiubmM":
                digest.update(values.tobytes())
        return SourceFile(self.name, digest.hexdigest())

    def read(self, names: Sequence[str]) -> dict[str, np.ndarray]:
        """Some columns as numbers; times of day as seconds since the first sample.

        Raises:
            UnknownColumn: there is no such column; names the nearest ones.
            RecordingError: a column holds something else than numbers.
        """
        return {name: self._numbers(name) for name in names}

    def _numbers(self, name: str) -> np.ndarray:
        """One column."""
        if name not in self.names:
            raise UnknownColumn(self.name, name, near_names(name, self.names), self.names)
        values = np.asarray(self.table[name])
        if values.dtype.kind == "M":
            values = values - values[:1]
        if values.dtype.kind == "m":
            return values / np.timedelta64(1, "s")
        try:
            return np.asarray(values, dtype=float)
        except (TypeError, ValueError) as error:
            raise RecordingError(
                f"column {name!r} of {self.name} holds no numbers ({error})",
                advice="convert it, or name another one",
            ).about("columns") from None
