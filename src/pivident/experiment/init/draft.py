"""From log and robot to a first experiment file that runs: recording, controller and methods.

Controller and methods: what runs best with what is known of the loop.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pivident.data.logs.file_columns import beside_text
from pivident.data.logs.recognition.channel_words import Sureness
from pivident.data.logs.recognition.log_file import Run
from pivident.data.logs.timestamps import check_declared
from pivident.estimation.methods import WITHOUT_TORQUE
from pivident.experiment.check.actuators_check import controller_keys
from pivident.experiment.init.assumption import (
    HEADING,
    UNKNOWN,
    Answers,
    Assumption,
    DraftError,
    Question,
    experiment_text,
)
from pivident.experiment.init.kept_joints import GivenRobot, RobotFile, robot_file
from pivident.experiment.init.log_files import read_runs
from pivident.experiment.init.recording_lines import RecordingLines, recording_lines
from pivident.experiment.init.trial import Findings, try_out
from pivident.foundation.text.display import Displayed
from pivident.robot.mjcf_actuators import ActuatorLaw
from pivident.robot.naming import ROBOT_FILES, nearest

#: Why those methods are taken where there is no torque.
_POSITIONS = "no torque was logged: simulated positions are compared with the measured ones"
#: Gains of the law that is asked for where there is no torque, and what they are.
GAINS = {
    "kp": "proportional gain kp, in N m/rad (N/m)",
    "kd": "derivative gain kd, in N m s/rad (N s/m)",
}


@dataclass(frozen=True, eq=False)
class Draft(Displayed):
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


def control_lines(found: RecordingLines, findings: Findings, answers: Answers) -> list[Assumption]:
    """Lines of ``[controller]``, ``[identify]`` and ``[validation]``."""
    if not found.has_torque:
        return [*_known_law(found, answers), *_methods(findings, WITHOUT_TORQUE, _POSITIONS)]
    lines: list[Assumption] = []
    law = law_to_try(found, findings)
    example = '"pd"\n# kp = [1000.0, 800.0]\n# kd = [50.0, 40.0]'
    if law == "identify":
        seen = "the control law is unknown, but the log has a reference: it is identified from that"
        seen += f"{findings.law_found}"
        lines.append(
            Assumption("controller", "type", law, "likely", seen, "Known gains are better.")
        )
    else:
        reason = findings.law_failed or "the control law is not known and the log has no reference"
        if found.link_torques:
            reason = "the control law drives the motors, which torques behind the gears do not show"
        seen = f"{reason}: no loop is simulated, instruments come from the record itself"
        lines.append(Assumption("controller", "type", None, "likely", seen, example=example))
    seen = "least squares beside instrumental variables, whose difference is the bias of the "
    seen += "loop; the verdict says which to take"
    return [*lines, *_methods(findings, ("ls", "iv-full-rate", "piv"), seen)]


def _methods(findings: Findings, names: Sequence[str], seen: str) -> Iterator[Assumption]:
    """Lines of ``[identify]`` and ``[validation]``: those of some methods that work."""
    methods = [m for m in names if m not in findings.failed]
    if findings.instruments:
        seen += f". Instruments: {findings.instruments}"
    if findings.failed:
        seen += ". " + ". ".join(f"{m} is left out: {why}" for m, why in findings.failed.items())
    yield Assumption("identify", "methods", methods, "likely", seen)
    if findings.folds is not None:
        seen = "the record is too short, or its rate too low, for more blocks of held-out motion"
        seen += "; 0: errors are those of the fitted motion"
        yield Assumption("validation", "folds", findings.folds, "certain", seen)


def _known_law(found: RecordingLines, answers: Answers) -> list[Assumption]:
    """Lines of the law that gives the torque that was not logged, as far as somebody knows it."""
    law, of_file = found.law, ""
    if law is not None and not law.reasons and not any(answers.get(key) for key in GAINS):
        return _law_of_actuators(found, law)
    if law is not None and law.reasons:
        of_file = f". Nor do the actuators of the robot's file: {'. '.join(law.reasons)}"
    seen = "no torque was logged, and the control law that was active gives it: its gains are the "
    seen += f"scale of all parameters, and nobody but you knows them{of_file}"
    correct = 'Or "pid" with ki, "cascade" with kp, kv and ki. Where the gains are not in N m (N): '
    correct += 'drive_gain, the joint torque per unit of the output, or "unknown" for ratios.'
    given = {key: _numbers(answers.get(key, "")) for key in GAINS}
    if not all(given.values()):
        known = UNKNOWN not in (answers.get(key) for key in GAINS)
        question = next((k for k in GAINS if known and not given[k]), None)
        example = '"pd"\n# kp = [1000.0, 800.0]\n# kd = [50.0, 40.0]\n# drive_gain = "unknown"'
        asked = None
        if question is not None:
            text = f"No torque was logged; the control law gives it. What is its {GAINS[question]}?"
            asked = Question(question, text, numbers=found.machine.size, optional=True)
        return [Assumption("controller", "type", None, "likely", seen, correct, asked, example)]
    lines = [Assumption("controller", "type", "pd", "assumed", f"{seen}; a PD law", correct)]
    for key, values in given.items():
        value = values[0] if len(values) == 1 else values
        lines.append(Assumption("controller", key, value, "certain", "as answered"))
    return lines


def _law_of_actuators(found: RecordingLines, law: ActuatorLaw) -> list[Assumption]:
    """Lines of the law that the actuators of the robot's file are."""
    file = Path(found.machine.description).name
    keys = controller_keys(law, any(line.key == "dq_ref" for line in found.recording))
    said = {
        "type": f"no torque was logged; the position actuators of {file} give it by this law",
        "speed_feed_forward": "position actuators of MuJoCo damp the speed itself: 0; a drive that "
        "damps the speed of the error: 1",
    }
    correct = {
        "type": " ".join(
            ("The gains are the scale of all parameters: where the log is of a real drive, its "
             "own belong here.", *(f"{note}." for note in law.notes))
        )
    }  # fmt: skip
    sure: Sureness = "assumed" if law.notes else "likely"
    return [
        Assumption(
            "controller", key, value, sure, said.get(key, f"of the actuators of {file}"),
            correct.get(key, ""),
        )
        for key, value in keys.items()
    ]  # fmt: skip


def _numbers(answer: str) -> list[float]:
    """The numbers of an answer, none where nobody knows."""
    if answer == UNKNOWN:
        return []
    return [float(word) for word in answer.replace(",", " ").split()]


def law_to_try(found: RecordingLines, findings: Findings) -> str | None:
    """``identify`` where the log has a reference and that has not failed yet, or none."""
    if found.link_torques or findings.law_failed or not found.has_reference:
        return None
    return "identify"


def draft_experiment(
    logs: Sequence[str | Path],
    robot: str | None = None,
    *,
    out: str | Path = "experiment.toml",
    joints: Sequence[str] = (),
    column_names: Sequence[str] = (),
    rate: float | None = None,
    gravity: str | None = None,
    bodies: Sequence[str] = (),
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
        joints: joints that are to be identified, the others stand still; all that are in the log
            otherwise.
        column_names: of logs without a header, in the order of their columns.
        rate: at which the log was taken, or new samples are made [Hz]; None: that of its clock.
        gravity: where it points in the base frame (``"-y"``), or three numbers with commas [m/s²].
        bodies: that were mounted and that the description lacks, such as ``"flange 2.75 kg"``.
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
    machine = robot_file(robot, paths, GivenRobot.of(gravity, bodies))
    for name in joints:
        if name not in machine.joint_names:
            raise DraftError(
                f"there is no joint {name!r}", advice=nearest(name, machine.joint_names)
            )
    answers = dict(answers or {})
    if rate is not None:
        check_declared(rate)
        answers["rate"] = str(rate)
    say("reading the log")
    runs = read_runs(paths, machine.joint_names, column_names)
    say("comparing log and robot")
    found = recording_lines(runs[0], machine, tuple(joints), answers)
    findings = Findings()
    while True:
        say("trying the file")
        lines = [
            *_robot_lines(machine, found, findings, out),
            *found.warmth,
            *control_lines(found, findings, answers),
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
    return Draft(text, (*robot_part, *recordings[0], *rest), findings.troubles, findings.explained)


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
    preset = next((file.preset for file in run.files if file.preset), None)
    if preset is not None:
        seen += f". Preset {preset.name}: {preset}"
    seen = ". ".join([seen, *(note.rstrip(".") for note in findings.notes)])
    lines = [Assumption("recording", "files", value, "certain", seen)]
    if column_names and single:
        seen = "the log has no header; as given, in the order of its columns"
        lines.append(Assumption("recording", "column_names", list(column_names), "certain", seen))
    tried = {line.key for line in findings.recording}
    others = [a for a in found.recording if a.table != "recording" or a.key not in tried]
    return [*lines, *findings.recording, *others]
