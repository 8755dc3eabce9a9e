"""The files of a log: several runs of the same columns, or one run in files side by side."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from pivident.init.assumption import DraftError
from pivident.logs.bags.bag_table import OwnClock, bag_table
from pivident.logs.bags.read_bag import is_bag
from pivident.logs.file_columns import read_columns
from pivident.logs.recognition.channel_words import Reading, read_words, words_of
from pivident.logs.recognition.column_series import JOINT, Series, column_series
from pivident.logs.source_files import printable_name

#: Endings that say nothing about a log.
ENDINGS = (".gz", ".csv", ".txt", ".tsv", ".npz", ".npy", ".mat", ".parquet")


@dataclass(frozen=True, eq=False)
class LogFile:
    """One file."""

    path: Path  # where it is
    columns: dict[str, np.ndarray]  # numeric, shape (samples,), in the units of the file
    series: tuple[Series, ...]  # columns that belong together
    # clocks of the columns that have one of their own, by name; these columns are taken at the
    # instants of the others, NaN where they say nothing
    own_clocks: Mapping[str, OwnClock] = field(default_factory=dict)

    @property
    def samples(self) -> int:
        """Number of rows."""
        return len(next(iter(self.columns.values())))

    @property
    def shown(self) -> str:
        """Its name as it can be printed."""
        return printable_name(self.path)


@dataclass(frozen=True, eq=False)
class Run:
    """One run of the robot: its files side by side."""

    files: tuple[LogFile, ...]


def read_runs(paths: Sequence[Path], joint_names: Sequence[str]) -> list[Run]:
    """Read the files: those with the same columns are runs, all others parts of one run."""
    files = [_read(path, joint_names) for path in paths]
    kinds = {reading.channel for f in files if (reading := file_reading(f.path)).channel}
    alike = len({tuple(n for n in f.columns if n not in f.own_clocks) for f in files}) == 1
    if len(files) > 1 and alike and len(kinds) < 2:
        return [Run((file,)) for file in files]
    rows = {file.samples for file in files}
    if len(rows) > 1:
        listed = ", ".join(f"{file.shown} has {file.samples}" for file in files)
        raise DraftError(
            f"the files of one run must have the same rows, but {listed}; join them by their time "
            "stamps first, or give runs of the same columns"
        )
    return [Run(tuple(files))]


def file_reading(path: Path) -> Reading:
    """What the name of a file says about its columns: ``arm_effort.csv``."""
    name = path.name
    for ending in ENDINGS:
        name = name.removesuffix(ending)
    return read_words([word for word in words_of(name) if len(word) > 2 or word in ("q", "dq")])


def _read(path: Path, joint_names: Sequence[str]) -> LogFile:
    clocks: dict[str, OwnClock] = {}
    if is_bag(path):
        columns, clocks = bag_table(path, tuple(joint_names))
    else:
        columns = read_columns(path)
    own = file_reading(path)
    series = []
    for found in column_series(list(columns), joint_names):
        bare = found.channel is None and not found.reading.foreign and JOINT in found.words
        if bare and own.channel is not None:
            # Only the file's name says what columns called after joints hold.
            found = replace(found, reading=replace(own, unit=found.reading.unit))
        series.append(found)
    return LogFile(path, columns, tuple(series), clocks)
