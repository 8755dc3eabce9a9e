"""The files of a log: several runs of the same columns, or one run in files side by side."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from pivident.data.logs.bags.bag_table import COVERED, OwnClock
from pivident.data.logs.clock_alignment import ClockedChannel, at_instants
from pivident.data.logs.recognition.log_clock import LogClock, names_time, read_clock
from pivident.data.logs.recognition.log_file import LogFile, Run, file_reading, read_log_file
from pivident.data.logs.tables.tables import names_in, without_header, written_out
from pivident.data.logs.timestamps import mean_rate
from pivident.experiment.init.assumption import DraftError


def read_runs(
    paths: Sequence[Path], joint_names: Sequence[str], column_names: Sequence[str] = ()
) -> list[Run]:
    """Read the files: those with the same columns are runs, all others parts of one run.

    Parts with other rows have clocks of their own, as topics of a bag that were exported apart.
    """
    names = _names_by_file(paths, column_names)
    several = len(set(names)) > 1
    files = [
        read_log_file(path, joint_names, own, one_of_several=several)
        for path, own in zip(paths, names, strict=True)
    ]
    unnamed = {f.shown: list(f.columns) for f in files if not (f.titles or _is_named(f.path))}
    if len(files) > 1 and (refused := without_header(unnamed)):
        raise DraftError.of_part("", refused)
    kinds = {reading.channel for f in files if (reading := file_reading(f.path)).channel}
    called = {tuple(f.title(n) for n in f.columns if n not in f.own_clocks) for f in files}
    if len(files) > 1 and len(called) == 1 and len(kinds) < 2:
        return [Run((file,)) for file in files]
    if len({file.samples for file in files}) > 1:
        return [Run(_side_by_side(files))]
    return [Run(tuple(files))]


def _is_named(path: Path) -> bool:
    """Whether the name of a file says what its columns hold: a quantity, or time."""
    return file_reading(path).channel is not None or names_time(path.name.partition(".")[0])


def _names_by_file(paths: Sequence[Path], given: Sequence[str]) -> list[tuple[str, ...]]:
    """Names of the columns of each file: all of them, or one after another where they are for all.

    Only files without a header have columns to be named.
    """
    names = tuple(written_out(given))
    if len(paths) < 2 or not names:
        return [names] * len(paths)
    widths = [len(own) if (own := names_in(p))[:1] == ("column_1",) else 0 for p in paths]
    if set(widths) == {len(names)}:  # runs of the same columns
        return [names] * len(paths)
    if sum(widths) != len(names):
        counts = ", ".join(f"{p.name} {width}" for p, width in zip(paths, widths, strict=True))
        raise DraftError(
            f"{len(names)} columns are named, but the files have others without a name ({counts})",
            advice="name all of them in their order, file after file, - for those that are not "
            "needed",
        )
    ends = np.cumsum(widths)
    return [names[end - width : end] for end, width in zip(ends, widths, strict=True)]


def _side_by_side(files: Sequence[LogFile]) -> tuple[LogFile, ...]:
    """Files of one run with other rows: the one with positions and torques, the others beside it.

    The others are taken at its instants, by the stamps of both.
    """
    base = max(files, key=lambda file: len(_channels(file) & {"q", "tau", "current"}))
    clocks = {file.path: read_clock(file.columns, None, None) for file in files}
    grid = clocks[base.path].seconds
    for clock in clocks.values():
        inside = (grid >= clock.seconds[0]) & (grid <= clock.seconds[-1])
        if clock.column is None or inside.mean() < COVERED:
            listed = ", ".join(f"{file.shown} has {file.samples}" for file in files)
            raise DraftError(
                f"the files of one run differ in their rows ({listed}) and have no stamps of the "
                "same time",
                advice="join them by their time stamps first, or give runs of the same columns",
            )
    others = [_beside(base, grid, f, clocks[f.path]) for f in files if f is not base]
    return (base, *(file for file in others if file.columns))


def _channels(file: LogFile) -> set[str | None]:
    """What the columns of a file seem to hold."""
    return {series.channel for series in file.series}


def _beside(base: LogFile, grid: np.ndarray, file: LogFile, clock: LogClock) -> LogFile:
    """What a file adds to another one, at the instants of that; ``clock``: its own."""
    series = tuple(s for s in file.series if s.channel not in {None, *_channels(base)})
    columns: dict[str, np.ndarray] = {}
    for own in series:
        names = list(own.columns.values())
        values = np.column_stack([file.columns[name] for name in names])
        rows = np.isfinite(values).all(axis=1)
        channel = ClockedChannel(
            str(own.channel), str(clock.column), clock.seconds[rows], values[rows]
        )
        columns |= zip(names, at_instants(channel, grid).T, strict=True)
    stamps = OwnClock(str(clock.column), mean_rate(clock.seconds))
    return replace(file, columns=columns, series=series, own_clocks=dict.fromkeys(columns, stamps))
