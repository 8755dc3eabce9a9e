"""Logs of an audit: a bare file, a table of an experiment file, or a public record."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pivident.audit.clocked_reading import bag_log, shown
from pivident.audit.column_names import guess_channels
from pivident.audit.described_reading import described_log
from pivident.audit.file_columns import clocks_in, read_columns
from pivident.audit.log import Log
from pivident.errors import RecordingError
from pivident.logs.bags.read_bag import is_bag
from pivident.logs.source_files import SourceFile
from pivident.recording import public_records
from pivident.robot.description import Robot

if TYPE_CHECKING:
    from pivident.experiment.schema import RecordingEntry

#: Public records: key of the file in its data set, and how it is to be read.
PUBLIC: dict[tuple[str, str], tuple[tuple[str, ...], dict[str, Any]]] = {
    ("staubli_tx40", "all"): (("q", "tau"), public_records.STAUBLI_TX40),
    ("emps", "estimation"): (("estimation",), public_records.EMPS),
    ("emps", "pulses"): (("pulses",), public_records.EMPS_PULSES),
    ("kuka_kr300", "A"): (("A",), public_records.KUKA_KR300),
    ("kuka_kr300", "B"): (("B",), public_records.KUKA_KR300),
}


def bare_log(path: str | Path, robot: Robot | None = None) -> Log:
    """A log of which nothing is known but its columns' names.

    Args:
        path: .csv, .txt, .tsv (also gzipped), .npz, .mat, .parquet, or a bag.
        robot: the robot, where it is known.

    Returns:
        The log, its channels assigned by their names as far as they are known.

    Raises:
        FileFormatError: the file cannot be read at all.
    """
    path = Path(path)
    if is_bag(path):
        return bag_log(path, robot)
    columns = read_columns(path)
    clocks, unit, notes = clocks_in(columns, None)
    names, joints = guess_channels(
        [n for n in columns if n not in clocks], robot.joint_names if robot else ()
    )
    logged = {kind: np.column_stack([columns[n] for n in own]) for kind, own in names.items()}
    if logged:
        taken = "; ".join(f"{kind} = {', '.join(own)}" for kind, own in names.items())
        notes.append(
            f"Columns were told from their names ({taken}) and taken for rad, N m and the joint "
            "side; an experiment file says it with certainty."
        )
    claimed = {n for own in names.values() for n in own}
    return Log(
        shown(path),
        tuple(joints),
        {n: v for n, v in columns.items() if n not in claimed},
        clocks,
        logged=logged,
        channels={kind: np.array(values) for kind, values in logged.items()},
        robot=robot,
        sources=(SourceFile.of(path),),
        notes=tuple(notes),
        clock_unit=unit,
    )


def entry_log(
    entry: RecordingEntry, robot: Robot | None, folder: Path, log: Path | None = None
) -> Log:
    """The log of one table ``[recording]`` of an experiment file.

    Args:
        entry: the table.
        robot: the robot.
        folder: what paths are relative to.
        log: another file with the same columns, instead of the table's.

    Raises:
        RecordingError: the log cannot be read.
        DatasetUnavailable: a public record is not here and cannot be fetched.
    """
    adjusted = {
        key: getattr(entry, key)
        for key in ("name", "control_rate", "torque_timing", "delay")
        if getattr(entry, key) is not None
    }
    if entry.dataset is not None:
        found = _public(entry.dataset, entry.run, robot, log, adjusted)
    else:
        assert entry.files is not None and entry.columns is not None, "the schema asks for both"
        files: Any = (
            {key: folder / path for key, path in entry.files.items()}
            if isinstance(entry.files, dict)
            else folder / entry.files
        )
        found = described_log(
            _instead(files, log),
            entry.columns.model_dump(exclude_unset=True),
            units=entry.units.model_dump(exclude_unset=True),
            side=entry.side,
            robot=robot,
            rate=entry.rate,
            resample=entry.resample,
            samples_axis=entry.samples_axis,
            position_offset=entry.position_offset,
            **adjusted,
        )
    return found if entry.part is None else found.between(*entry.part)


def _public(
    dataset: str, run: str | None, robot: Robot | None, log: Path | None, adjusted: dict[str, Any]
) -> Log:
    """A public record as it was published."""
    from pivident.recording.datasets import fetch

    chosen = run or next((r for d, r in PUBLIC if d == dataset), "")
    if (dataset, chosen) not in PUBLIC:
        known = ", ".join(f"{d} ({r})" for d, r in PUBLIC)
        raise RecordingError(
            f"there is no public record {dataset!r} {run or ''}; there are {known}"
        )
    keys, facts = PUBLIC[dataset, chosen]
    files = fetch(dataset, *keys)
    single: Any = files if len(keys) > 1 else files[keys[0]]
    machine: dict[str, Any] = {"robot": robot} if robot else {}
    if dataset == "kuka_kr300" and robot is None:
        machine = {"transmission": public_records.KR300_TRANSMISSION}
    return described_log(_instead(single, log), **(facts | machine | adjusted))


def _instead(files: Any, log: Path | None) -> Any:
    """The files of the table, or another log with the same columns."""
    if log is None:
        return files
    if isinstance(files, Mapping):
        raise RecordingError(
            f"the experiment file has {len(files)} files ({', '.join(files)}), so that {log.name} "
            "cannot take their place; audit the experiment file itself"
        )
    return log
