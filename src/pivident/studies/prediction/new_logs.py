"""From the files of a result and of new logs to what is predicted, and what it is compared with.

A log without torque is read as well, and nothing is compared.

A result from its files, with what is stored beside it that a prediction can be compared with.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pivident.data.logs.described_log import bare_log
from pivident.data.logs.log import Log
from pivident.data.logs.read_log import read_log
from pivident.data.recording.load import OF_LOGGER, load_recording, recording_from
from pivident.data.recording.recording import Recording
from pivident.dynamics.friction import FrictionWarming
from pivident.estimation.equation_record import MotionRange
from pivident.estimation.identification import Identification
from pivident.estimation.stored_identification import json_of_file, load_identification
from pivident.experiment.recording_tables import Part, between_gaps, reading_of
from pivident.foundation.errors import ExperimentError, RecordingError, UnknownColumn
from pivident.foundation.text.display import Displayed
from pivident.judgement.diagnostics.stored_verdict import RESULT, held_out_errors, result_of
from pivident.judgement.validation.held_out.held_out_errors import HeldOutErrors
from pivident.models.model_json import MODEL, read_model
from pivident.models.runnable_model import RunnableModel, runnable_model
from pivident.models.stored_model import stored_model
from pivident.robot.description import Robot
from pivident.robot.gallery import load_robot
from pivident.robot.naming import ROBOT_FILES
from pivident.studies.prediction.predict import predict
from pivident.studies.prediction.prediction import Prediction

if TYPE_CHECKING:
    from pivident.experiment.experiment import Experiment

#: Channels that are read.
CHANNELS: tuple[str, ...] = ("q", "tau")
#: Fields of the recording, by which nothing is refused that can be predicted.
LENIENT: dict[str, Any] = {"allow_constant": True, "saturation": "allow"}


@dataclass(frozen=True, eq=False)
class NewLog:
    """A recording for a prediction.

    Attributes:
        recording: positions and, where it was measured, torque, SI, joint side.
        note: how the log was read, a sentence.
    """

    recording: Recording
    note: str


@dataclass(frozen=True, eq=False)
class StoredResult(Displayed):
    """A result with what it knows about its own logs.

    Attributes:
        model: what predicts the torques.
        file: where it is from.
        readings: arguments of `load_recording` by which its own logs were read.
        fitted: range of the fitted motion, or None.
        held_out: errors on motion that was held out, or None.
        warming: how friction changes with temperature.
    """

    model: Identification | RunnableModel
    file: Path
    readings: tuple[Mapping[str, Any], ...] = ()
    fitted: MotionRange | None = None
    held_out: HeldOutErrors | None = None
    warming: tuple[FrictionWarming, ...] = ()

    def predict(
        self, recording: Recording, *, compare: bool = True, band: float | None = None
    ) -> Prediction:
        """Torques of a recording beside what is stored, see `predict`.

        Args:
            recording: of the same robot.
            compare: whether its torque was measured.
            band: highest frequency of the motion [Hz].
        """
        return predict(
            self.model,
            recording,
            compare=compare,
            held_out=self.held_out,
            fitted=self.fitted,
            band=band,
            warming=self.warming,
        )


def stored_result(path: str | Path, experiment: str | Path | None = None) -> StoredResult:
    """A result of `pivident identify`, a model made from it, or a robot with nominal values.

    Args:
        path: ``identification.json``, ``consistent.json``, a model as JSON, a folder of results (of
            several methods the one that the verdict recommends), or a robot: a URDF, a TOML, or a
            name in the gallery.
        experiment: experiment file by which a robot stands as its log was made: gravity, joints
            that are frozen, bodies, drives and friction of its table ``[robot]``.

    Returns:
        The result.

    Raises:
        IdentificationFileError: the file holds no result.
        RobotDescriptionError: the robot cannot be used.
    """
    file = Path(path)
    if file.suffix != ".json" and not file.is_dir():
        return StoredResult(runnable_model(_mounted(path, experiment)), file)
    file = result_of(file)
    content = json_of_file(file)
    if content.get("format") == MODEL.name:
        return StoredResult(read_model(file), file)
    if "standard" in content and "covariance" not in content:
        return _of_consistent(file, content)
    return _of_identification(load_identification(file), file)


def _mounted(path: str | Path, experiment: str | Path | None) -> Robot:
    """A robot that is described, as the experiment file has it."""
    if experiment is None:
        return load_robot(path)
    from pivident.experiment.experiment import load_experiment

    given, model = load_experiment(experiment), str(path)
    model = str(Path(path).absolute()) if model.endswith(ROBOT_FILES) else model
    entry = given.content.robot.model_copy(update={"model": model})
    return replace(given, content=given.content.model_copy(update={"robot": entry})).robot


def _of_identification(found: Identification, file: Path) -> StoredResult:
    errors = held_out_errors(file.parent, found.method)
    warming = found.friction_warming
    return StoredResult(found, file, found.readings, found.fitted_range, errors, warming)


def _of_consistent(file: Path, content: Mapping[str, Any]) -> StoredResult:
    """Consistent parameters, and what the identification beside them knows, if it is theirs."""
    model, _ = stored_model(file)
    beside = file.with_name(RESULT)
    if not beside.is_file():
        return StoredResult(model, file)
    if hashlib.sha256(beside.read_bytes()).hexdigest() != model.origin.identification:
        return StoredResult(model, file)
    free = _of_identification(load_identification(beside), beside)
    return replace(free, model=model, file=file)


def check_same_joints(result: StoredResult, names: tuple[str, ...], where: str) -> None:
    """Refuse a description of another robot's log."""
    own = result.model.robot.joint_names
    if names != own:
        raise ExperimentError(
            f"{where} has the joints {', '.join(names)}, the result those of another robot: "
            f"{', '.join(own)}",
            advice="describe a log of the robot that was identified",
        )


def new_logs(
    log: str | Path | Mapping[str, str | Path],
    result: StoredResult,
    experiment: str | Path | None = None,
) -> Iterator[NewLog]:
    """The recordings of a log or of an experiment file.

    Args:
        log: a log, or several files of one by channel, or an experiment file that names logs.
        result: gives the robot, and how its own logs were read.
        experiment: experiment file that describes the columns of the log.

    Raises:
        RecordingError: the log cannot be read in this way.
        ExperimentError: the experiment file cannot be used, or is that of another robot.
    """
    if isinstance(log, Mapping):
        if not result.readings or experiment is not None:
            raise RecordingError(
                f"{', '.join(f'{key}={own}' for key, own in log.items())}: files by channel are "
                "read as the logs of an identification were",
                advice="name them in an experiment file, files = {q = …, tau = …}, and name that",
            )
        files = {key: Path(own) for key, own in log.items()}
        shown = ", ".join(own.name for own in files.values())
        note = f"{shown} were read as the logs of the result were: columns, units, side, timing."
        yield from _read(files, _fitting(result, files), result.model.robot, note)
        return
    path = Path(log)
    is_experiment = path.suffix.lower() == ".toml"
    if is_experiment and experiment is not None:
        raise RecordingError(
            f"{path.name} is an experiment file itself",
            advice="leave --experiment out, or name the log",
        )
    if is_experiment or experiment is not None:
        from pivident.experiment.experiment import load_experiment

        given = load_experiment(path if is_experiment else Path(str(experiment)))
        check_same_joints(result, given.robot.joint_names, given.path.name)
        yield from _described(given, None if is_experiment else path)
        return
    if not result.readings:
        yield from _bare(path, result.model.robot)
        return
    reading = _fitting(result, path)
    if reading["columns"]["q"] == reading["columns"].get("tau"):
        raise RecordingError(
            "the logs of the result have positions and torques in files of their own, in columns "
            "of the same names",
            advice=f"name both files: q={path.name} tau=…",
        )
    note = f"{path.name} was read as the logs of the result were: columns, units, side, timing."
    yield from _read(path, reading, result.model.robot, note)


def _described(given: Experiment, other: Path | None) -> Iterator[NewLog]:
    """Every recording of an experiment file; or another log by the description of the first."""
    from pivident.experiment.explained import errors_name

    entries = given.content.recording if other is None else given.content.recording[:1]
    for entry in entries:
        with errors_name(given.path, "[recording]"):
            files, reading = reading_of(entry, given.robot, given.path.parent)
            note = f"{entry.name or entry.dataset or files} was read as {given.path.name} says."
            if other is not None:
                files, note = other, f"{other.name} was read as {given.path.name} says."
            part = (
                (entry.part[0], entry.part[1]) if entry.part is not None and other is None else None
            )
            yield from _read(files, reading, given.robot, note, part)


def _fitting(result: StoredResult, path: Path | Mapping[str, Path]) -> Mapping[str, Any]:
    """The first reading whose columns the log has, else the first."""
    for reading in result.readings:
        try:
            read_log(path, _channels(reading, ("q",))["columns"], robot=result.model.robot)
        except RecordingError:
            continue
        return reading
    return result.readings[0]


def _read(
    files: Any, reading: Mapping[str, Any], robot: Robot, note: str, whole: Part | None = None
) -> Iterator[NewLog]:
    """A log, or the stretches between its gaps, by the arguments of `load_recording`.

    Without its torque where it has none; ``whole``: what is read of it [s], None: all.
    """
    known = dict(reading) | {"robot": robot} | _channels(reading, CHANNELS)
    warm = reading["columns"].get("temperature")
    if warm is not None and _has(files, warm):
        known["columns"] |= {"temperature": warm}

    def one(part: Part | None) -> Recording:
        part = part or whole
        recording = load_recording(files, **known, **LENIENT, part=part)
        return recording if part is None else recording.slice(*part)

    try:
        for recording in between_gaps(one, bool(known.get("resample")))[0]:
            missing = " No column of its torque is named: nothing is compared."
            yield _noted(recording, note if recording.has_torque else note + missing)
        return
    except UnknownColumn as error:
        if error.place != ("columns", "tau") or _has_some_torque(files, known):
            raise
        missing = f" It has no torque (no {error.column}): nothing is compared."
    known |= _channels(reading, ("q",))
    log = read_log(files, **{k: v for k, v in known.items() if k not in OF_LOGGER})
    yield from _strict(log, whole, note + missing)


def _channels(reading: Mapping[str, Any], names: tuple[str, ...]) -> dict[str, dict[str, Any]]:
    """Columns and units of some channels, with their clock."""
    chosen = {
        table: {k: v for k, v in reading[table].items() if k in (*names, "t") and v is not None}
        for table in ("columns", "units")
    }
    clock = chosen["columns"].get("t")
    if isinstance(clock, Mapping) and "columns" not in clock:  # one for each channel
        chosen["columns"]["t"] = {k: v for k, v in clock.items() if k in names}
    return chosen


def _has_some_torque(files: Any, known: Mapping[str, Any]) -> bool:
    """Whether the log has some of the torque's columns, so that another one is misspelt."""
    spec = known["columns"]["tau"]
    beside = {} if not isinstance(spec, Mapping) or "file" not in spec else {"file": spec["file"]}
    listed = spec["columns"] if isinstance(spec, Mapping) else spec
    columns = [] if isinstance(listed, str) else listed
    return any(_has(files, beside | {"columns": [column]}) for column in columns)


def _has(files: Any, spec: Any) -> bool:
    """Whether the log has the columns of a channel."""
    try:
        read_log(files, {"tau": spec})
    except UnknownColumn:
        return False
    return True


def _bare(path: Path, robot: Robot) -> Iterator[NewLog]:
    """A log of which nothing is known but the names of its columns."""
    log = bare_log(path, robot)
    if "q" not in log.logged:
        raise RecordingError(
            f"{path.name}: no positions of {', '.join(robot.joint_names)} were recognised by the "
            "names of its columns, and the result does not hold how its own logs were read",
            advice="describe the log by an experiment file, and name that",
        )
    log = replace(log, logged={k: x for k, x in log.logged.items() if k in CHANNELS})
    if log.clocks:
        described = replace(log.description, units={"t": "s"}, clock=next(iter(log.clocks)))
        log = replace(log, columns=log.clocks, description=described)
    note = " ".join(log.notes)
    if "tau" not in log.logged:
        note = f"{note} No torque was recognised: nothing is compared.".strip()
    yield from _strict(log, None, note)


def _strict(log: Log, whole: Part | None, note: str) -> Iterator[NewLog]:
    """A log made strict, or the stretches between its gaps."""

    def one(part: Part | None) -> Recording:
        part = part or whole
        recording = recording_from(log, **LENIENT, part=part)
        return recording if part is None else recording.slice(*part)

    for recording in between_gaps(one, log.resample)[0]:
        yield _noted(recording, note)


def _noted(recording: Recording, note: str) -> NewLog:
    """A recording with how it was read, and what of it was left out."""
    return NewLog(recording, " ".join([note, *recording.notes]).strip())
