"""From the tables ``[recording]`` and ``[controller]`` to logs, recordings and their loop."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pivident.data.logs.bags.read_bag import is_bag
from pivident.data.logs.log import Log
from pivident.data.logs.tables.tables import named_columns
from pivident.data.recording.checks import usual_timing
from pivident.data.recording.load import OF_LOGGER, load_recording
from pivident.data.recording.public_records import RUNS, load_public, public_facts
from pivident.data.recording.recording import Recording
from pivident.foundation.errors import (
    BrokenMotion,
    ExperimentError,
    GapInClock,
    IrregularSampling,
    MissingSamples,
    RecordingError,
    RecordingTooShort,
    UnknownColumn,
    concerning,
)
from pivident.foundation.files import named_file
from pivident.foundation.options import per_joint
from pivident.foundation.text.sentences import capital
from pivident.loop.simulation.control_loop import Loop, virtual_pd
from pivident.loop.simulation.controllers import PID, UNKNOWN_GAIN, Cascade, Controller
from pivident.robot.description import Robot
from pivident.robot.naming import near_names, nearest

if TYPE_CHECKING:
    from pivident.experiment.file_keys import ControllerEntry, RecordingEntry

#: What `pivident excite` calls a design, and the log of its motion may lie beside.
DESIGN_FILE = "design.json"

#: What cuts a log into stretches.
Gap = MissingSamples | GapInClock | BrokenMotion

#: First and last time of a part of a log [s].
Part = tuple[float, float]

#: Fewest samples of a stretch between gaps: three times what filters spoil at its two ends.
MIN_STRETCH = 300

#: Fields of a recording that a file may set for a public record too.
ADJUSTABLE = (
    "name",
    "control_rate",
    "torque_timing",
    "delay",
    "drive_delay",
    "saturation",
    "allow_constant",
    "torque_side",
)


def one_by_one(entries: Sequence[RecordingEntry], folder: Path) -> list[RecordingEntry]:
    """The tables with those of many runs, ``files = "runs/*.parquet"``, taken apart."""
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
                f"files = {entry.files!r}: no file fits this pattern in {folder}",
                advice="check the folder and the ending",
            ).about("files")
        if entry.name is not None and len(files) > 1:
            raise ExperimentError(
                f"name = {entry.name!r} is given to the {len(files)} runs of {entry.files!r}",
                advice="leave it out, they are named by their files",
            ).about("name")
        found += [entry.model_copy(update={"files": str(path)}) for path in files]
    return found


def recording_of(entry: RecordingEntry, robot: Robot, folder: Path) -> Recording:
    """One recording, read, checked, and cut to its part."""
    set_here = _adjusted(entry, ADJUSTABLE)
    if entry.dataset is not None:
        run = _public_run(entry.dataset, entry.run)
        with concerning("dataset"):
            public = load_public(entry.dataset, run, robot=robot)
        recording = replace(public, **set_here)
    else:
        part = None if entry.part is None else (entry.part[0], entry.part[1])
        recording = load_recording(
            _files(entry, folder),
            **_description(entry, robot, folder),
            robot=robot,
            part=part,
            **set_here,
        )
    with concerning("design"):
        named = design_file(entry, folder)
        if entry.design is not None and named is not None and not named.is_file():
            raise ExperimentError(
                f"the design {named} does not exist",
                advice="name its design.json or folder, or leave the key out: one beside the log "
                "is found",
            )
    with concerning("part"):
        return recording if entry.part is None else recording.slice(*entry.part)


def run_of(
    entry: RecordingEntry, robot: Robot, folder: Path
) -> tuple[tuple[Recording, ...], Gap | None]:
    """The run of one table, see `between_gaps`."""

    def read(part: Part | None) -> Recording:
        own = entry if part is None else entry.model_copy(update={"part": part})
        return recording_of(own, robot, folder)

    return between_gaps(read, entry.resample)


def between_gaps(
    read: Callable[[Part | None], Recording], resample: bool
) -> tuple[tuple[Recording, ...], Gap | None]:
    """A log as one recording, or as one for each stretch between gaps and breaks.

    Nothing is used over a gap, and everything on both sides of it.

    Args:
        read: reads the log, or a part of it [s].
        resample: whether new samples fill the shorter gaps.

    Returns:
        The recordings, and the gaps or breaks between them; None: there is one recording.

    Raises:
        RecordingError: the log cannot be used, or no stretch of it is long enough.
    """
    try:
        return (read(None),), None
    except (MissingSamples, GapInClock, BrokenMotion) as gap:
        left = gap.stretches
        if left.resample and not resample:
            raise
        cause, kept = gap, []
        for part in left.parts:
            try:
                kept.append(read(part))
            except (RecordingTooShort, IrregularSampling):
                continue
        kept = [recording for recording in kept if recording.samples >= MIN_STRETCH]
        if not kept:
            raise
    used = sum(recording.duration for recording in kept)
    return tuple(
        replace(
            recording,
            name=f"{recording.name}, {recording.start_time:.4g} s on",
            notes=(
                *recording.notes,
                f"{capital(cause.fact)}: {used:.4g} s of {left.seconds:.4g} s "
                f"are used, in {len(kept)} stretch(es).",
            ),
        )
        for recording in kept
    ), cause


def design_file(entry: RecordingEntry, folder: Path) -> Path | None:
    """The design of the motion that was recorded: the one that is named, or one beside the log.

    Args:
        entry: table of the recording.
        folder: folder of the experiment file.
    """
    if entry.design is not None:
        named = named_file(folder, entry.design)
        return named / DESIGN_FILE if named.is_dir() else named
    if entry.files is None:
        return None
    files = _files(entry, folder)
    logs = files.values() if isinstance(files, dict) else [files]
    beside = dict.fromkeys(log.parent / DESIGN_FILE for log in logs)
    return next((path for path in beside if path.is_file()), None)


def log_of(
    entry: RecordingEntry, robot: Robot | None, folder: Path, other: Path | None = None
) -> Log:
    """The log of one table, read and judged by nobody."""
    from pivident.data.logs.described_log import described_log

    files, reading = reading_of(entry, robot, folder, other)
    reading.setdefault("torque_timing", usual_timing(reading.get("torque_side", "motor")))
    for key in ("drive_delay", "torque_side"):  # a part of the model, not of the log
        reading.pop(key, None)
    log = described_log(_instead(files, other), **(reading | {"robot": robot}))
    with concerning("part"):
        return log if entry.part is None else log.between(*entry.part)


def reading_of(
    entry: RecordingEntry, robot: Robot | None, folder: Path, other: Path | None = None
) -> tuple[Any, dict[str, Any]]:
    """Files of one table, and the arguments of `load_recording` that describe them.

    ``other``: another log of the same columns, whose header they are named by.
    """
    set_here = _adjusted(entry, ("name", *OF_LOGGER))
    if entry.dataset is None:
        return _files(entry, folder), _description(entry, robot, folder, other) | set_here
    files, facts = public_facts(entry.dataset, _public_run(entry.dataset, entry.run), robot)
    return files, dict(facts) | set_here


def loop_of(
    entry: ControllerEntry, robot: Robot, recordings: Sequence[Recording]
) -> tuple[tuple[Recording, ...], Loop]:
    """The control loop, or a virtual one, and the recordings with measured or rebuilt reference."""
    n = robot.size - robot.base_joints
    law: Controller | None = None
    if entry.type == "virtual_pd":
        posture = np.mean([recording.q.mean(axis=0) for recording in recordings], axis=0)
        posture, fixed = posture[robot.base_joints :], robot.on_fixed_base
        given = {k: v for k in ("bandwidth", "damping") if (v := getattr(entry, k)) is not None}
        law = virtual_pd(fixed, posture, **given)
    elif entry.type != "identify":
        law = control_law(entry, n)
    gain = per_joint("drive_gain", entry.gain, n)
    limit = np.full(n, np.inf) if entry.limit is None else per_joint("limit", entry.limit, n)
    count = size_of_count("counts", entry.counts, robot.on_fixed_base)
    if law is None or entry.source == "reconstruct":
        from pivident.estimation.control_law.unknown_loop import reconstruct_loop

        made, loop = reconstruct_loop(
            robot.on_fixed_base,
            [recording.behind(robot.base_joints) for recording in recordings],
            law,
            entry.source == "reconstruct",
            gain,
            limit,
        )
        if robot.base_joints:
            made = tuple(
                recording.with_reference_of(own)
                for recording, own in zip(recordings, made, strict=True)
            )
        return made, replace(
            loop,
            feed_forward=entry.feed_forward,
            count=count,
        )
    return tuple(recordings), Loop(
        law,
        gain,
        limit,
        reference=entry.source,
        feed_forward=entry.feed_forward,
        count=count,
        gain_known=entry.drive_gain != UNKNOWN_GAIN,
    )


def size_of_count(key: str, counts: Any, robot: Robot) -> np.ndarray:
    """What encoders count in, zero where they do not, shape (joints,) [rad or m].

    ``counts``: per revolution of the joint, or per metre; of all joints or of each; ``key``: its
    key in the file.
    """
    given = per_joint(key, 0.0 if counts is None else counts, robot.size)
    if (given < 0).any():
        raise ExperimentError(
            f"{key} = {counts} cannot be negative",
            advice="give counts per revolution of the joint, or per metre, and 0 for a joint "
            "whose encoder is fine",
        ).about(key)
    whole = np.array([2.0 * np.pi if j.kind == "revolute" else 1.0 for j in robot.joints])
    return np.divide(whole, given, out=np.zeros(robot.size), where=given > 0)


def control_law(entry: ControllerEntry, joints: int) -> Controller:
    """PD, PID or cascade with the gains of the file."""
    gains = {
        key: per_joint(key, value, joints)
        for key in ("kp", "kd", "kv", "ki")
        if (value := getattr(entry, key)) is not None
    }
    share = entry.feed_forward_share
    if entry.type == "cascade":
        return Cascade(averaged=entry.averaged, speed_feed_forward=share, **gains)
    return PID(derivative_time=entry.derivative_time, speed_feed_forward=share, **gains)


def _public_run(dataset: str, run: str | None) -> str:
    """The run of a public record, the first where none is named."""
    if dataset not in RUNS:
        raise ExperimentError(
            f"no data set {dataset!r} can be named here",
            advice=f"{nearest(dataset, RUNS)}; others need files and columns",
        ).about("dataset")
    runs = RUNS[dataset]
    chosen = next(iter(runs)) if run is None else run
    if chosen not in runs:
        raise ExperimentError(
            f"the data set {dataset!r} has no run {chosen!r}", advice=nearest(chosen, runs)
        ).about("run")
    return chosen


def _adjusted(entry: RecordingEntry, keys: Sequence[str]) -> dict[str, Any]:
    """Those of some keys that the file sets."""
    return {key: value for key in keys if (value := getattr(entry, key)) is not None}


def _files(entry: RecordingEntry, folder: Path) -> Any:
    """The user's own files."""
    assert entry.files is not None, "the schema requires it"
    if isinstance(entry.files, dict):
        return {key: named_file(folder, path) for key, path in entry.files.items()}
    return named_file(folder, entry.files)


def columns_in_file(
    entry: RecordingEntry, folder: Path, other: Path | None = None
) -> dict[str, Any]:
    """Columns of each channel as the log's file calls them, or another log in its place."""
    assert entry.columns is not None, "the schema requires it"
    columns = entry.columns.model_dump(exclude_unset=True)
    if entry.column_names is None:
        return columns
    path = other or _files(entry, folder)
    with concerning("column_names"):
        named = named_columns(path, entry.column_names)

    def translated(spec: Any) -> Any:
        if isinstance(spec, dict):
            return {key: translated(value) for key, value in spec.items()}
        if isinstance(spec, list):
            return [translated(value) for value in spec]
        if spec in named or not isinstance(spec, str) or spec in named.values():
            return named.get(spec, spec)
        raise UnknownColumn(path.name, spec, near_names(spec, named), tuple(named))

    made = {}
    for channel, spec in columns.items():
        with concerning("columns", channel):
            made[channel] = translated(spec)
    return made


def _description(
    entry: RecordingEntry, robot: Robot | None, folder: Path, other: Path | None = None
) -> dict[str, Any]:
    """What the file says about the columns of a log; one temperature is that of all joints."""
    columns = columns_in_file(entry, folder, other)
    warm, q = columns.get("temperature"), columns["q"]
    if robot is not None and isinstance(warm, str):
        warm = [warm] * robot.on_fixed_base.size
    if isinstance(entry.files, dict) and isinstance(warm, list):
        own = "temperature" if "temperature" in entry.files else "q"
        warm = {"file": q.get("file", "q") if isinstance(q, dict) else own, "columns": warm}
    columns |= {} if warm is None else {"temperature": warm}
    return {
        "columns": columns,
        "units": entry.units.model_dump(exclude_unset=True),
        "side": entry.side,
        "rate": entry.rate,
        "resample": entry.resample,
        "samples_axis": entry.samples_axis,
        "position_offset": entry.position_offset,
    }


def _instead(files: Any, other: Path | None) -> Any:
    """The files of the table, or another log with the same columns."""
    if other is None:
        return files
    if isinstance(files, Mapping):
        raise RecordingError(
            f"the experiment file has {len(files)} files ({', '.join(files)}), so that "
            f"{other.name} cannot take their place",
            advice="audit the experiment file itself",
        )
    return other
