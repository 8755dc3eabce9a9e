"""The load of the table ``[payload]`` of an experiment file.

The file has both records, the one without load under ``[recording]`` and the one with load under
``[[payload.recording]]``; or the arm was identified earlier, and ``[recording]`` is the loaded one.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields, replace
from pathlib import Path

import numpy as np

from pivident.estimation.identification import Identification
from pivident.estimation.method import Method
from pivident.estimation.problem import Problem
from pivident.experiment.experiment import Experiment
from pivident.experiment.explained import errors_name
from pivident.experiment.file_keys import LoadEntry
from pivident.foundation.errors import ExperimentError
from pivident.robot.frames import Pose, rotation_from_rpy
from pivident.studies.payload.arm_and_load import KnownParts
from pivident.studies.payload.identify_payload import identify_payload
from pivident.studies.payload.payload_identification import PayloadIdentification

#: Default methods for the load of an experiment with and without a control loop.
WITH_LOOP, WITHOUT_LOOP = "piv", "ls"


def load_of(
    experiment: Experiment,
    arm: Identification | None = None,
    method: str | None = None,
    progress: Callable[[str], None] | None = None,
) -> PayloadIdentification:
    """The load of an experiment file.

    Args:
        experiment: the file.
        arm: the arm identified earlier, without load; the file's recordings are then those with
            load. None: the file has both.
        method: name of the method; default: that of ``[payload]``, or else ``piv`` with a
            controller and ``ls`` without.
        progress: called with one line at each stage.

    Raises:
        PividentError: file, recordings and arm do not match, or the motion is not sufficient.
    """
    given = experiment.content.payload or LoadEntry()
    with errors_name(experiment.path, "[payload]"):
        if arm is None and not given.recording:
            raise ExperimentError(
                "there is no record with the load",
                advice="add [[payload.recording]], or give the arm identified without it: "
                "pivident payload EMPTY.json LOADED.toml",
            )
        if arm is not None and given.recording:
            raise ExperimentError(
                "[[payload.recording]] is given together with an arm identified earlier",
                advice="put the record with the load under [recording]",
            )
    every = _with_loaded_recordings(experiment, given)
    chosen = _method(every, method or given.method)
    empty: Problem | Identification
    if arm is None:
        runs = every.runs()
        together = every.problem(progress, [recording for run in runs for recording in run])
        count = sum(map(len, runs[: len(experiment.content.recording)]))
        loaded = replace(together, recordings=together.recordings[count:])
        empty = replace(together, recordings=together.recordings[:count])
    else:
        empty, loaded = arm, experiment.problem(progress)
    with errors_name(experiment.path, "[payload]"):
        return identify_payload(
            empty,
            loaded,
            chosen,
            link=given.link,
            known=KnownParts(**{f.name: getattr(given, f.name) for f in fields(KnownParts)}),
            frame=_frame(given),
            friction_under_load=given.friction_under_load,
            progress=progress,
        )


def _with_loaded_recordings(experiment: Experiment, given: LoadEntry) -> Experiment:
    """The file with the loaded recordings appended to those without load."""
    content = experiment.content
    every = [*content.recording, *given.recording]
    return Experiment(experiment.path, content.model_copy(update={"recording": every}))


def _method(experiment: Experiment, name: str | None) -> Method:
    """The method with the file's options."""
    if name is None:
        name = WITHOUT_LOOP if experiment.content.controller is None else WITH_LOOP
    return experiment.methods([name])[name]


def _frame(given: LoadEntry) -> Pose | None:
    """Frame of the tool in that of the link, if the file has one."""
    if given.frame is None:
        return None
    return Pose(rotation_from_rpy(*given.frame.rpy), np.array(given.frame.xyz, dtype=float))


def default_folder(path: Path) -> Path:
    """Folder of the results: NAME-payload for NAME.toml."""
    return Path(f"{path.stem}-payload")
