"""From log and robot to a first experiment file that runs as it is."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pivident.init.assumption import Answers, Assumption, DraftError, Question
from pivident.init.control_lines import control_lines
from pivident.init.experiment_text import HEADING, experiment_text
from pivident.init.log_files import read_runs
from pivident.init.recording_lines import RecordingLines, recording_lines
from pivident.init.robot_file import RobotFile, robot_file
from pivident.init.trial import Findings, try_out
from pivident.logs.file_columns import beside_text
from pivident.logs.recognition.log_file import Run
from pivident.robot.naming import ROBOT_FILES, nearest


@dataclass(frozen=True, eq=False)
class Draft:
    """A first experiment file.

    Attributes:
        text: the file.
        assumptions: its lines, those of the first recording only.
        troubles: what stands in the way of an identification, as sentences.
        explained: relative error of a first least squares, by joint; empty where there was none.
    """

    text: str
    assumptions: tuple[Assumption, ...]
    troubles: tuple[str, ...]
    explained: dict[str, float]

    @property
    def questions(self) -> tuple[Question, ...]:
        """What only a person knows."""
        return tuple(a.question for a in self.assumptions if a.question is not None)


def draft_experiment(
    logs: Sequence[str | Path],
    robot: str | None = None,
    *,
    out: str | Path = "experiment.toml",
    joints: Sequence[str] = (),
    column_names: Sequence[str] = (),
    answers: Answers | None = None,
    progress: Callable[[str], None] | None = None,
) -> Draft:
    """Find what an experiment file needs, and try whether it runs.

    The file is not written. What it says is held against the log: its recordings are read as
    `pivident identify` would read them, a control law is looked for where there is a reference,
    and what does not work is left out, with the reason.

    Args:
        logs: files of one run side by side, or several runs of the same columns.
        robot: gallery name, .toml, URDF or MJCF; None: the only URDF beside the logs.
        out: where the file is going to be; its paths are relative to that folder.
        joints: joints of a URDF that are to be identified; all that are in the log otherwise.
        column_names: of logs without a header, in the order of their columns.
        answers: what a person answered to `Draft.questions`, by what they are about.
        progress: called with one line at each stage.

    Returns:
        The text of the file, every assumption in it, and what only a person can answer.

    Raises:
        DraftError: no robot, no positions or no torques can be found.
        FileFormatError: a log cannot be read.
        RobotDescriptionError: the robot cannot be used.
    """
    say, out = progress or (lambda line: None), Path(out)
    paths = [Path(log) for log in logs]
    if not paths:
        raise DraftError("no log is given", advice="name at least one file")
    machine = robot_file(robot, paths)
    for name in joints:
        if name not in machine.joint_names:
            raise DraftError(
                f"there is no joint {name!r}", advice=nearest(name, machine.joint_names)
            )
    say("reading the log")
    runs = read_runs(paths, machine.joint_names, column_names)
    say("comparing log and robot")
    found = recording_lines(runs[0], machine, tuple(joints), answers or {})
    findings = Findings()
    while True:
        say("trying the file")
        lines = [
            *_robot_lines(machine, found, findings, out),
            *control_lines(found, findings, answers or {}),
        ]
        recordings = [_recording(run, found, findings, out, column_names) for run in runs]
        heading = HEADING.format(
            names=", ".join(f.shown for run in runs for f in run.files), file=out.name
        )
        text = experiment_text(recordings, lines, heading, findings.troubles)
        if findings.settled:
            break
        with _existing(out.absolute().parent):
            findings = try_out(text, out, findings, say)
    robot_part = [a for a in lines if a.table == "robot"]
    rest = [a for a in lines if a.table != "robot"]
    assumptions = (*robot_part, *recordings[0], *rest)
    return Draft(text, assumptions, findings.troubles, findings.explained)


def relative_path(path: Path, out: Path) -> str:
    """A path as the file names it: relative where that is short, with forward slashes."""
    folder = out.absolute().parent
    try:
        relative = os.path.relpath(path.absolute(), folder)
    except ValueError:  # another drive
        relative = str(path.absolute())
    if relative.count("..") > 3:
        relative = str(path.absolute())
    try:
        relative.encode("utf-8")
    except UnicodeEncodeError:
        raise DraftError(f"the name of {path!r} is no text", advice="rename the file") from None
    return relative.replace(os.sep, "/")


@contextmanager
def _existing(folder: Path) -> Iterator[None]:
    """A folder that may not exist yet: a path from it over ``..`` can only be read if it does."""
    missing = [path for path in (folder, *folder.parents) if not path.exists()]
    folder.mkdir(parents=True, exist_ok=True)
    try:
        yield
    finally:
        for path in missing:
            with suppress(OSError):  # somebody has used it
                path.rmdir()


def _robot_lines(
    machine: RobotFile, found: RecordingLines, findings: Findings, out: Path
) -> list[Assumption]:
    """The table ``[robot]``."""
    is_file = machine.name.endswith(ROBOT_FILES)
    model = relative_path(Path(machine.name), out) if is_file else machine.name
    seen = "the only URDF beside the log" if machine.found else "as given"
    sure = "likely" if machine.found else "certain"
    lines = [Assumption("robot", "model", model, sure, seen)]  # type: ignore[arg-type]
    lines += found.robot
    lines += findings.friction or [_present_friction(found)]
    if not found.link_torques and not np.any(found.machine.rotor_inertia):
        lines.append(
            Assumption(
                "robot", "rotor_inertia", None, "likely",
                "rotor inertias are not in the description; they are estimated (ia1 …), starting "
                "at zero. Nominal values on the joint side, in kg m², help where they are known",
                example=f"[{', '.join(['0.0'] * found.machine.size)}]",
            )
        )  # fmt: skip
    return lines


def _present_friction(found: RecordingLines) -> Assumption:
    """The line that says which law of friction is taken where the file says nothing."""
    law = found.machine.joints[0].friction
    seen = f"friction of every joint is {law}, as of the robot's description or by default; "
    seen += "`pivident laws` compares others"
    if found.link_torques:
        seen = "behind the gears only bearings rub: viscous and Coulomb friction stay in the model "
        seen += "of a joint where they are significant; laws given here stay as they are"
    example = '["viscous", "coulomb", "offset"]'
    return Assumption("robot", "friction", None, "likely", seen, example=example)


def _recording(
    run: Run, found: RecordingLines, findings: Findings, out: Path, column_names: Sequence[str]
) -> list[Assumption]:
    """The tables of one recording."""
    files = {key: relative_path(run.files[k].path, out) for key, k in found.file_keys.items()}
    single = len(files) == 1 and not any(c in next(iter(files.values())) for c in "*?")
    value = next(iter(files.values())) if single else files
    clocks = any(run.files[k].own_clocks for k in found.file_keys.values())
    rows = "each with stamps of its own" if clocks else "with the same rows"
    seen = "as given" if len(files) == 1 else f"one run in files side by side, {rows}"
    seen += "".join(
        f"; {file.shown} holds more{beside_text(file.beside)}" for file in run.files if file.beside
    )
    seen = ". ".join([seen, *(note.rstrip(".") for note in findings.notes)])
    lines = [Assumption("recording", "files", value, "certain", seen)]
    if column_names and single:
        seen = "the log has no header; as given, in the order of its columns"
        lines.append(Assumption("recording", "column_names", list(column_names), "certain", seen))
    tried = {line.key for line in findings.recording}
    others = [a for a in found.recording if a.table != "recording" or a.key not in tried]
    return [*lines, *findings.recording, *others]
