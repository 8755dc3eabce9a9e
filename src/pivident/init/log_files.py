"""The files of a log: several runs of the same columns, or one run in files side by side."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from pivident.init.assumption import DraftError
from pivident.logs.recognition.log_file import Run, file_reading, read_log_file


def read_runs(
    paths: Sequence[Path], joint_names: Sequence[str], column_names: Sequence[str] = ()
) -> list[Run]:
    """Read the files: those with the same columns are runs, all others parts of one run."""
    files = [read_log_file(path, joint_names, column_names) for path in paths]
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
