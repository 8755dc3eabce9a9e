"""Controller and methods: what runs best with what is known of the loop."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from pivident.check.actuators_check import controller_keys
from pivident.estimation.methods import WITHOUT_TORQUE
from pivident.init.assumption import UNKNOWN, Answers, Assumption, Question
from pivident.logs.recognition.sureness import Sureness

if TYPE_CHECKING:
    from pivident.init.recording_lines import RecordingLines
    from pivident.init.trial import Findings
    from pivident.robot.mjcf_actuators import ActuatorLaw


#: Why those methods are taken where there is no torque.
_POSITIONS = "no torque was logged: simulated positions are compared with the measured ones"

#: Gains of the law that is asked for where there is no torque, and what they are.
GAINS = {
    "kp": "proportional gain kp, in N m/rad (N/m)",
    "kd": "derivative gain kd, in N m s/rad (N s/m)",
}


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
    return lines + _methods(findings, ("ls", "iv-full-rate", "piv"), seen)


def _methods(findings: Findings, names: Sequence[str], seen: str) -> list[Assumption]:
    """Lines of ``[identify]`` and ``[validation]``: those of some methods that work."""
    lines = []
    methods = [m for m in names if m not in findings.failed]
    if findings.instruments:
        seen += f". Instruments: {findings.instruments}"
    if findings.failed:
        seen += ". " + ". ".join(f"{m} is left out: {why}" for m, why in findings.failed.items())
    lines.append(Assumption("identify", "methods", methods, "likely", seen))
    if findings.folds is not None:
        seen = "the record is too short, or its rate too low, for more blocks of held-out motion"
        seen += "; 0: errors are those of the fitted motion"
        lines.append(Assumption("validation", "folds", findings.folds, "certain", seen))
    return lines


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
    with_speeds = any(line.key == "dq_ref" for line in found.recording)
    keys = controller_keys(law, with_speeds)
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
