"""The files of a log: several runs of the same columns, or one run in files side by side."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from pivident.init.assumption import DraftError
from pivident.logs.bags.bag_table import OwnClock
from pivident.logs.clocks.timestamps import mean_rate
from pivident.logs.recognition.log_clock import LogClock, read_clock
from pivident.logs.recognition.log_file import LogFile, Run, file_reading, read_log_file

#: Share of the rows of a log that stamps of another file have to cover.
COVERED = 0.5


def read_runs(
    paths: Sequence[Path], joint_names: Sequence[str], column_names: Sequence[str] = ()
) -> list[Run]:
    """Read the files: those with the same columns are runs, all others parts of one run.

    Parts with other rows have clocks of their own, as topics of a bag that were exported apart.
    """
    files = [read_log_file(path, joint_names, column_names) for path in paths]
    kinds = {reading.channel for f in files if (reading := file_reading(f.path)).channel}
    alike = len({tuple(n for n in f.columns if n not in f.own_clocks) for f in files}) == 1
    if len(files) > 1 and alike and len(kinds) < 2:
        return [Run((file,)) for file in files]
    if len({file.samples for file in files}) > 1:
        return [Run(_side_by_side(files))]
    return [Run(tuple(files))]


def _side_by_side(files: Sequence[LogFile]) -> tuple[LogFile, ...]:
    """Files of one run with other rows: the one with positions and torques, the others beside it.

    The others are taken at its instants, by the stamps of both.
    """
    base = max(files, key=lambda file: len(_channels(file) & {"q", "tau", "current"}))
    clock = _clock(base)
    others = [_beside(base, clock, file) for file in files if file is not base]
    if clock is None or any(other is None for other in others):
        listed = ", ".join(f"{file.shown} has {file.samples}" for file in files)
        raise DraftError(
            f"the files of one run have other rows ({listed}) and no stamps of the same time; join "
            "them by their time stamps first, or give runs of the same columns"
        )
    return (base, *(other for other in others if other is not None))


def _channels(file: LogFile) -> set[str | None]:
    """What the columns of a file seem to hold."""
    return {series.channel for series in file.series}


def _clock(file: LogFile) -> LogClock | None:
    """The stamps of a file, None where it has none that advance."""
    clock = read_clock(file.columns, None, None)
    return None if clock.column is None else clock


def _beside(base: LogFile, clock: LogClock | None, file: LogFile) -> LogFile | None:
    """A file at the instants of another, without what that has itself; None without its stamps."""
    own = _clock(file)
    if clock is None or own is None or own.column is None:
        return None
    inside = (clock.seconds >= own.seconds[0]) & (clock.seconds <= own.seconds[-1])
    if inside.mean() < COVERED:
        return None
    series = tuple(s for s in file.series if s.channel not in _channels(base) - {None})
    stamps = OwnClock(own.column, mean_rate(own.seconds))
    columns = {
        name: np.where(inside, np.interp(clock.seconds, own.seconds, values), np.nan)
        for name, values in file.columns.items()
        if name != own.column
    }
    clocks = dict.fromkeys(columns, stamps)
    return LogFile(file.path, columns, series, clocks, file.joint_names)
