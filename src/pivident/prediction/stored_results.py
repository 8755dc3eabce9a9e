"""A result from its files, with what is stored beside it that a prediction can be compared with."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pivident.diagnostics.verdict_file import RESULT, held_out_errors, result_of
from pivident.errors import ExperimentError
from pivident.estimation.equation_record import MotionRange
from pivident.estimation.identification import Identification
from pivident.estimation.stored_identification import json_of_file, load_identification
from pivident.models.model_json import FORMAT, read_model
from pivident.models.runnable_model import RunnableModel, runnable_model
from pivident.models.stored_model import stored_model
from pivident.prediction.predict import predict
from pivident.prediction.prediction import Prediction
from pivident.recording.recording import Recording
from pivident.robot.gallery import load_robot
from pivident.validation.held_out.held_out_errors import HeldOutErrors


@dataclass(frozen=True, eq=False)
class StoredResult:
    """A result with what it knows about its own logs.

    Attributes:
        model: what predicts the torques.
        file: where it is from.
        readings: arguments of `load_recording` by which its own logs were read.
        fitted: range of the fitted motion, or None.
        held_out: errors on motion that was held out, or None.
    """

    model: Identification | RunnableModel
    file: Path
    readings: tuple[Mapping[str, Any], ...] = ()
    fitted: MotionRange | None = None
    held_out: HeldOutErrors | None = None

    def predict(self, recording: Recording, *, compare: bool = True) -> Prediction:
        """Torques of a recording beside what is stored, see `predict`.

        Args:
            recording: of the same robot.
            compare: whether its torque was measured.
        """
        return predict(
            self.model, recording, compare=compare, held_out=self.held_out, fitted=self.fitted
        )


def stored_result(path: str | Path) -> StoredResult:
    """A result of `pivident identify`, a model made from it, or a robot with nominal values.

    Args:
        path: ``identification.json``, ``consistent.json``, a model as JSON, a folder of results (of
            several methods the one that the verdict recommends), or a robot: a URDF, a TOML, or a
            name in the gallery.

    Returns:
        The result.

    Raises:
        IdentificationFileError: the file holds no result.
        RobotDescriptionError: the robot cannot be used.
    """
    file = Path(path)
    if file.suffix != ".json" and not file.is_dir():
        return StoredResult(runnable_model(load_robot(path)), file)
    file = result_of(file)
    content = json_of_file(file)
    if content.get("format") == FORMAT:
        return StoredResult(read_model(file), file)
    if "standard" in content and "covariance" not in content:
        return _of_consistent(file, content)
    return _of_identification(load_identification(file), file)


def _of_identification(found: Identification, file: Path) -> StoredResult:
    errors = held_out_errors(file.parent, found.method)
    return StoredResult(found, file, found.readings, found.fitted_range, errors)


def _of_consistent(file: Path, content: Mapping[str, Any]) -> StoredResult:
    """Consistent parameters, and what the identification beside them knows, if it is theirs."""
    model, _ = stored_model(file)
    beside = file.with_name(RESULT)
    if not beside.is_file():
        return StoredResult(model, file)
    if hashlib.sha256(beside.read_bytes()).hexdigest() != model.origin.identification:
        return StoredResult(model, file)
    free = _of_identification(load_identification(beside), beside)
    return StoredResult(model, file, free.readings, free.fitted, free.held_out)


def check_same_joints(result: StoredResult, names: tuple[str, ...], where: str) -> None:
    """Refuse a description of another robot's log."""
    own = result.model.robot.joint_names
    if names != own:
        raise ExperimentError(
            f"{where} has the joints {', '.join(names)}, the result those of another robot: "
            f"{', '.join(own)}",
            advice="describe a log of the robot that was identified",
        )
