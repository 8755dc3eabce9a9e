"""A file of a log as columns, and those that belong together; the files of one run."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from pivident.logs.bags.bag_table import OwnClock, bag_table
from pivident.logs.bags.read_bag import is_bag
from pivident.logs.file_columns import file_columns
from pivident.logs.recognition.channel_words import Reading, read_words, words_of
from pivident.logs.recognition.column_series import JOINT, Series, column_series
from pivident.logs.recognition.time_columns import is_clock
from pivident.logs.source_files import printable_name
from pivident.logs.tables.column_names import named_columns
from pivident.logs.tables.tables import endings


@dataclass(frozen=True, eq=False)
class LogFile:
    """One file."""

    path: Path  # where it is
    columns: dict[str, np.ndarray]  # numeric, shape (samples,), in the units of the file
    series: tuple[Series, ...]  # columns that belong together
    # clocks of the columns that have one of their own, by name; these columns are taken at the
    # instants of the others, NaN where they say nothing
    own_clocks: Mapping[str, OwnClock] = field(default_factory=dict)
    joint_names: tuple[str, ...] = ()  # of the robot, or as the messages of a bag call them
    aside: tuple[str, ...] = ()  # other topics of a bag with positions
    titles: Mapping[str, str] = field(default_factory=dict)  # given to columns without a header
    constants: Mapping[str, np.ndarray] = field(default_factory=dict)  # gains, ratios, by name
    beside: Mapping[str, str] = field(default_factory=dict)  # why all else is no column, by name

    @property
    def samples(self) -> int:
        """Number of rows."""
        return len(next(iter(self.columns.values())))

    def title(self, column: str) -> str:
        """What somebody calls a column, else its own name."""
        return self.titles.get(column, column)

    @property
    def shown(self) -> str:
        """Its name as it can be printed."""
        return printable_name(self.path)


@dataclass(frozen=True, eq=False)
class Run:
    """One run of the robot: its files side by side."""

    files: tuple[LogFile, ...]


def read_log_file(
    path: Path,
    joint_names: Sequence[str] = (),
    column_names: Sequence[str] = (),
    *,
    one_of_several: bool = False,
) -> LogFile:
    """The columns of a file, of a bag those of its arm; see `joint_columns` for the next step.

    ``column_names``: of a table without a header. They become those of its columns, unless it is
    ``one_of_several`` files, of which an experiment file takes the columns by number.
    """
    if is_bag(path):
        arm = bag_table(path, tuple(joint_names))
        series = column_series(list(arm.columns), arm.joint_names)
        return LogFile(
            path, arm.columns, tuple(series), arm.own_clocks, arm.joint_names, arm.aside,
            beside=arm.beside,
        )  # fmt: skip
    held = file_columns(path)
    columns, titles = held.columns, {}
    if column_names:
        named = named_columns(path, column_names)
        if one_of_several:
            titles = {own: name for name, own in named.items()}
        else:
            columns = {name: columns[own] for name, own in named.items() if own in columns}
    names = {titles.get(n, n): n for n, values in columns.items()}
    names = {title: n for title, n in names.items() if not is_clock(title, columns[n])}
    own = file_reading(path)
    series = []
    for found in column_series(list(names), joint_names):
        bare = found.channel is None and not found.reading.foreign and JOINT in found.words
        if bare and own.channel is not None:
            # Only the file's name says what columns called after joints hold.
            found = replace(found, reading=replace(own, unit=found.reading.unit))
        series.append(replace(found, columns={k: names[n] for k, n in found.columns.items()}))
    return LogFile(
        path, columns, tuple(series), joint_names=tuple(joint_names), titles=titles,
        constants=held.constants, beside=held.beside,
    )  # fmt: skip


def file_reading(path: Path) -> Reading:
    """What the name of a file says about its columns: ``arm_effort.csv``."""
    name = path.name
    for ending in (".gz", *endings()):
        name = name.removesuffix(ending)
    return read_words([word for word in words_of(name) if len(word) > 2 or word in ("q", "dq")])
