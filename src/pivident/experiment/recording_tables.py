"""From the tables ``[recording]`` and ``[controller]`` to recordings and their loop."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from pivident.control_law.unknown_loop import reconstruct_loop
from pivident.errors import ExperimentError
from pivident.experiment.schema import ControllerEntry, RecordingEntry
from pivident.logs.bags.read_bag import is_bag
from pivident.recording import public_records
from pivident.recording.load import load_recording
from pivident.recording.recording import Recording
from pivident.robot.description import Robot
from pivident.robot.naming import nearest
from pivident.simulation.control_loop import Loop
from pivident.simulation.controllers import PID, Cascade, Controller
from pivident.simulation.virtual_pd import virtual_pd

#: Fields of a recording that a file may set for a public record too.
ADJUSTABLE = (
    "name",
    "control_rate",
    "torque_timing",
    "delay",
    "drive_delay",
    "saturation",
    "allow_constant",
)

Loader = Callable[[Robot], Recording]

#: Public records that can be named, by data set and run; the first run is the default.
RUNS: dict[str, dict[str, Loader]] = {
    "staubli_tx40": {"all": lambda robot: public_records.load_staubli_tx40(robot=robot)},
    "emps": {
        "estimation": lambda robot: public_records.load_emps(robot=robot),
        "pulses": lambda robot: public_records.load_emps_pulses(robot=robot),
    },
    "kuka_kr300": {
        "A": lambda robot: public_records.load_kuka_kr300("A", robot=robot),
        "B": lambda robot: public_records.load_kuka_kr300("B", robot=robot),
    },
}


def one_by_one(entries: Sequence[RecordingEntry], folder: Path) -> list[RecordingEntry]:
    """The tables with those of many runs, ``files = "runs/*.parquet"``, taken apart.

    Args:
        entries: tables of an experiment file.
        folder: what paths are relative to.

    Returns:
        One table for each run, those of one pattern in the order of their files' names.

    Raises:
        ExperimentError: no file fits a pattern, or one name is given to several runs.
    """
    found = []
    for entry in entries:
        if not isinstance(entry.files, str) or not any(c in entry.files for c in "*?"):
            found.append(entry)
            continue
        anchor, pattern = folder, entry.files
        if Path(pattern).is_absolute():
            anchor = Path(Path(pattern).anchor)
            pattern = str(Path(pattern).relative_to(anchor))
        files = sorted(path for path in anchor.glob(pattern) if path.is_file() or is_bag(path))
        if not files:
            raise ExperimentError(
                f"files = {entry.files!r}: no file fits this pattern in {folder}; check the "
                "folder and the ending"
            )
        if entry.name is not None and len(files) > 1:
            raise ExperimentError(
                f"name = {entry.name!r} is given to the {len(files)} runs of {entry.files!r}; "
                "leave it out, they are named by their files"
            )
        found += [entry.model_copy(update={"files": str(path)}) for path in files]
    return found


def recording_of(entry: RecordingEntry, robot: Robot, folder: Path) -> Recording:
    """One recording, read, checked, and cut to its part.

    Args:
        entry: the table.
        robot: gives joint names, kinds and transmission.
        folder: what paths are relative to.

    Raises:
        ExperimentError: there is no such public record.
        RecordingError: a file or its content cannot be used.
        DatasetUnavailable: a public record is not here and cannot be fetched.
    """
    set_here = {key: getattr(entry, key) for key in ADJUSTABLE if getattr(entry, key) is not None}
    if entry.dataset is not None:
        recording = replace(_public(entry.dataset, entry.run)(robot), **set_here)
    else:
        recording = _from_files(entry, robot, folder, set_here)
    return recording if entry.part is None else recording.slice(*entry.part)


def loop_of(
    entry: ControllerEntry, robot: Robot, recordings: Sequence[Recording]
) -> tuple[tuple[Recording, ...], Loop]:
    """The control loop that the recordings were taken in, or a virtual one.

    Recordings come back with the reference that they have, or with a reconstructed one.

    Args:
        entry: the table ``[controller]``.
        robot: the robot.
        recordings: what a virtual law is to follow, or a law is to be identified from.

    Raises:
        ExperimentError: gains of the wrong number.
        IdentificationError: no law can be identified.
    """
    n = robot.size
    law: Controller | None = None
    if entry.type == "virtual_pd":
        posture = np.mean([recording.q.mean(axis=0) for recording in recordings], axis=0)
        given = {k: v for k in ("bandwidth", "damping") if (v := getattr(entry, k)) is not None}
        law = virtual_pd(robot, posture, **given)
    elif entry.type != "identify":
        law = control_law(entry, n)
    gain = _gains("drive_gain", entry.drive_gain, n)
    limit = np.full(n, np.inf) if entry.limit is None else _gains("limit", entry.limit, n)
    if law is None or entry.source == "reconstruct":
        made, loop = reconstruct_loop(
            robot, recordings, law, entry.source == "reconstruct", gain, limit
        )
        return made, replace(loop, feed_forward=entry.feed_forward)
    return tuple(recordings), Loop(
        law, gain, limit, reference=entry.source, feed_forward=entry.feed_forward
    )


def control_law(entry: ControllerEntry, joints: int) -> Controller:
    """PD, PID or cascade with the gains of the file."""
    gains = {
        key: _gains(key, value, joints)
        for key in ("kp", "kd", "kv", "ki")
        if (value := getattr(entry, key)) is not None
    }
    if entry.type == "cascade":
        return Cascade(
            averaged=entry.averaged, speed_feed_forward=entry.speed_feed_forward, **gains
        )
    return PID(derivative_time=entry.derivative_time, **gains)


def _gains(key: str, value: float | list[float], joints: int) -> np.ndarray:
    """One number for each joint."""
    values = np.asarray(value, dtype=float)
    if values.ndim and values.shape != (joints,):
        raise ExperimentError(
            f"key {key!r} has {values.size} number(s) for {joints} joint(s); give one for all "
            "or one for each"
        )
    return np.broadcast_to(values, (joints,)).copy()


def _public(dataset: str, run: str | None) -> Loader:
    """The loader of a public record."""
    if dataset not in RUNS:
        raise ExperimentError(
            f"no data set {dataset!r} can be named here; {nearest(dataset, RUNS)}; others need "
            "files and columns"
        )
    runs = RUNS[dataset]
    chosen = next(iter(runs)) if run is None else run
    if chosen not in runs:
        raise ExperimentError(
            f"the data set {dataset!r} has no run {chosen!r}; {nearest(chosen, runs)}"
        )
    return runs[chosen]


def _from_files(
    entry: RecordingEntry, robot: Robot, folder: Path, options: dict[str, Any]
) -> Recording:
    """A recording from the user's own files."""
    assert entry.files is not None and entry.columns is not None, "the schema asks for both"
    files: Any = (
        {key: folder / path for key, path in entry.files.items()}
        if isinstance(entry.files, dict)
        else folder / entry.files
    )
    columns = entry.columns.model_dump(exclude_unset=True)
    return load_recording(
        files,
        columns,
        units=entry.units.model_dump(exclude_unset=True),
        side=entry.side,
        robot=robot,
        rate=entry.rate,
        resample=entry.resample,
        samples_axis=entry.samples_axis,
        position_offset=entry.position_offset,
        part=None if entry.part is None else (entry.part[0], entry.part[1]),
        simulated=entry.simulated,
        **options,
    )
