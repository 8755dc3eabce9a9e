"""A first experiment file for a project, drafted beside the server.

An example to begin with: the textbook arm in its loop, with the log of its controller.
"""

from __future__ import annotations

import csv
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from pivident.app.studio.projects import EXPERIMENT, HIDDEN
from pivident.data.logs.recognition.log_file import read_log_file
from pivident.experiment.init.draft import Draft, draft_experiment
from pivident.foundation.errors import PividentError
from pivident.foundation.files import atomic_folder
from pivident.foundation.text.plain_values import plain, write_json
from pivident.loop.simulation.control_loop import Loop
from pivident.loop.simulation.controllers import PD
from pivident.loop.simulation.simulated_record import simulate
from pivident.robot.gallery import load_robot

#: The draft, in the folder of what is derived.
DRAFT = "draft.json"


def draft(
    project: Path,
    logs: Sequence[str],
    robot: str | None,
    answers: Mapping[str, str],
    joints: Sequence[str],
    column_names: Sequence[str],
    say: Callable[[str], None],
) -> None:
    """Write the draft of an experiment file with its questions; the file itself is not touched.

    What stands in the way is the ``error`` of ``draft.json``.

    Args:
        project: folder of the project.
        logs: names of its logs, relative to it.
        robot: gallery name, or name of a robot file in the project; None: the only URDF there.
        answers: to the questions of a draft before, by what they are about.
        joints: joints that are to be identified; all that are in the log otherwise.
        column_names: of logs without a header, in the order of their columns.
        say: called with one line at each stage.
    """
    content: dict[str, Any] = {
        "text": "", "questions": [], "troubles": [], "explained": {}, "assumptions": [],
        "left_out": {}, "error": ""
    }  # fmt: skip
    drafted = partial(
        draft_experiment,
        robot=str(project / robot) if robot and (project / robot).is_file() else robot,
        out=project / EXPERIMENT,
        joints=joints,
        column_names=column_names,
        answers=dict(answers),
        progress=say,
    )
    try:
        made, left_out = _of_readable(drafted, project, logs, column_names)
    except (PividentError, OSError) as error:
        content["error"] = " ".join(str(error).split())
    else:
        content |= {
            "text": made.text,
            "questions": [asdict(question) for question in made.questions],
            "troubles": list(made.troubles),
            "left_out": left_out,
            "explained": made.explained,
            "assumptions": [asdict(line) for line in made.assumptions],
        }
    with atomic_folder(project / HIDDEN) as build:
        write_json(build / DRAFT, plain(content))


def _of_readable(
    drafted: Callable[[list[Path]], Draft],
    project: Path,
    logs: Sequence[str],
    column_names: Sequence[str],
) -> tuple[Draft, dict[str, str]]:
    """The draft from all logs, or else from those that can be read; the others with the reason."""
    try:
        return drafted([project / log for log in logs]), {}
    except PividentError:
        unread = _unreadable(project, logs, column_names)
        if not unread or len(unread) == len(logs):
            raise
    return drafted([project / log for log in logs if log not in unread]), unread


def _unreadable(project: Path, logs: Sequence[str], column_names: Sequence[str]) -> dict[str, str]:
    """Logs that cannot be read by themselves, each with the reason."""
    found = {}
    for log in logs:
        try:
            read_log_file(project / log, (), column_names)
        except (PividentError, OSError) as error:
            found[log] = " ".join(str(error).split())
    return found


#: The robot of the gallery, its gains [N m per rad, N m s per rad], and the log [Hz, s].
ROBOT, KP, KD = "planar_2r", (6000.0, 2500.0), (180.0, 60.0)
RATE, DURATION = 1000.0, 12.0

#: Noise of encoders in the loop [rad] and of the torque sensors [N m].
ENCODER, TORQUE = 2e-5, 0.15

HEADER = ("time", "q1", "q2", "q1_ref", "q2_ref", "tau1", "tau2")


def draft_example(folder: Path, say: Callable[[str], None], seed: int = 0) -> None:
    """Simulate the arm, write its ``log.csv``, and draft the experiment file.

    Args:
        folder: of the new project.
        say: called with one line at each stage.
        seed: of motion and noise.
    """
    say("simulating the log of the example (the first time this compiles, for a minute)")
    write_log(folder, seed)
    draft(folder, ["log.csv"], ROBOT, {}, (), (), say)


def write_log(folder: Path, seed: int = 0) -> None:
    """The log of the arm, positions in degrees."""
    record = simulate(
        load_robot(ROBOT),
        Loop(PD(kp=KP, kd=KD)),
        rate=RATE,
        duration=DURATION,
        encoder=ENCODER,
        torque=TORQUE,
        seed=seed,
    ).recording
    time = np.arange(record.samples) / record.rate
    assert record.q_ref is not None  # a simulated loop follows one
    degrees = np.rad2deg(np.hstack([record.q, record.q_ref]))
    with atomic_folder(folder) as build:
        with (build / "log.csv").open("w", encoding="utf-8", newline="") as file:
            writer = csv.writer(file)
            writer.writerow(HEADER)
            rows = np.column_stack([time, degrees, record.tau])
            writer.writerows([f"{x:.9g}" for x in row] for row in rows)
