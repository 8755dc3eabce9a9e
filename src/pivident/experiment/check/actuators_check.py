"""The declared control law beside that of the robot's own actuators.

Position actuators of an MJCF are kp (q_ref - q) - kd dq: they damp the speed itself, a PD law the
speed of the error. A law of the wrong form is fitted by joints with its gain on speed as damping.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from pivident.data.recording.recording import Recording
from pivident.experiment.check.gains_check import CONTROLLER, of_joint
from pivident.experiment.file_keys import ControllerEntry
from pivident.foundation.errors import PividentError
from pivident.foundation.text.finding import Finding, FindingKind, Severity
from pivident.foundation.text.repair import Edit, Repair
from pivident.loop.simulation.controllers import UNKNOWN_GAIN
from pivident.robot.description import Robot
from pivident.robot.mjcf_actuators import ActuatorLaw, actuator_law
from pivident.robot.naming import MJCF_FILES

ACTUATORS = FindingKind(CONTROLLER, "actuators", ("controller", "type"))

#: Relative difference of gains that is none, and share of the reach that a command may exceed.
EQUAL = 0.01


def controller_keys(law: ActuatorLaw, with_speeds: bool) -> dict[str, Any]:
    """The table ``[controller]`` of the actuators of a file.

    Args:
        law: of the actuators, without reasons against it.
        with_speeds: whether the log has reference speeds.
    """
    share = law.speed_feed_forward(with_speeds)
    keys: dict[str, Any] = {"type": "pd", "kp": _plain(law.kp), "kd": _plain(law.kd)}
    if share not in (None, 1.0) and law.kd.any():
        keys["speed_feed_forward"] = share
    if np.isfinite(law.limit).all():
        keys["limit"] = _plain(law.limit)
    return keys


def check_actuators(
    entry: ControllerEntry | None, robot: Robot, recordings: Sequence[Recording] = ()
) -> list[Finding]:
    """Where the declared law differs from the position actuators of the robot's MJCF.

    Args:
        entry: the table ``[controller]``, as far as there is one.
        robot: read from a file, whose path is its description.
        recordings: whose references are held against what the actuators can be commanded.
    """
    if entry is None or not robot.description.endswith(MJCF_FILES):
        return []
    if entry.type not in ("pd", "pid", "cascade") or entry.drive_gain == UNKNOWN_GAIN:
        return []
    try:
        law = actuator_law(robot.description, robot.joint_names)
    except PividentError:  # said where the robot is read
        return []
    if not law.kp.any():
        return []
    file, names, n = Path(robot.description).name, robot.joint_names, robot.size
    if law.reasons:
        return [
            ACTUATORS.finding(
                "note", f"Not all actuators of {file} hold a position: {law.reasons[0]}."
            )
        ]
    share = law.speed_feed_forward(any(run.dq_ref is not None for run in recordings))
    gain, kp, kd = (
        np.array([of_joint(x, j) for j in range(n)])
        for x in (entry.gain, entry.kp, entry.kd if entry.kv is None else entry.kv)
    )
    found: list[tuple[str, str, str, Any]] = []
    if share is not None and abs(entry.feed_forward_share - share) > EQUAL and (kd * law.kd).any():
        said = f"damps by {_form(entry.feed_forward_share)}, the actuators of {file} by "
        said += f"{_form(share)}: the difference is found as damping of the joints"
        found.append(("speed_feed_forward", said, f"write speed_feed_forward = {share:g}", share))
    products = {"kp": (gain * kp, law.kp, law.kp), "kd": (gain * kd, law.kd, law.kd)}
    if entry.type == "cascade":
        inner = law.kp / np.where(law.kd, law.kd, np.inf)
        products = {"kp": (gain * kp * kd, law.kp, gain * inner), "kv": products["kd"]}
    for key, (declared, of_file, right) in products.items():
        off = np.flatnonzero(np.abs(declared - of_file) > EQUAL * np.maximum(of_file, declared))
        listed = ", ".join(f"{names[j]} {declared[j]:.5g} (file: {of_file[j]:.5g})" for j in off)
        said = f"has other gains {key} in joint torque than the actuators of {file}: {listed}"
        if off.size:
            gains = _plain(right / gain)
            found.append((key, said, f"write {key} = {gains}", gains))
    if entry.ki is not None and np.any(entry.ki):
        said = f"has an integrator, the actuators of {file} have none"
        found.append(("ki", said, "leave ki out", None))
    if entry.limit is None and np.isfinite(law.limit).all():
        said = f"has no limit, the actuators of {file} have"
        limits = _plain(law.limit / gain)
        found.append(("limit", said, f"write limit = {limits}", limits))
    ask = "If the log is of these actuators, {}; other drives have their own law."
    findings = [
        _finding("warning", f"The law under [controller] {said}.", ask.format(step), key, value)
        for key, said, step, value in found
    ]
    for run in recordings if np.isfinite(law.reach).any() else ():
        for j, (low, high) in enumerate(law.reach):
            q_ref = run.q if run.q_ref is None else run.q_ref
            ends, unit = (q_ref[:, j].min(), q_ref[:, j].max()), robot.joints[j].position_unit
            if ends[0] < low - EQUAL * abs(low) or ends[1] > high + EQUAL * abs(high):
                said = f"The reference of {names[j]} goes from {ends[0]:.4g} to {ends[1]:.4g} "
                said += f"{unit}, beyond ctrlrange in {file}, {low:.4g} to {high:.4g} {unit}."
                step = "MuJoCo cuts it off there; check the unit of q_ref, or log what is applied."
                findings.append(ACTUATORS.finding("warning", said, names[j], step))
    return findings


def _form(share: float) -> str:
    """What a gain on speed acts on, as a formula."""
    if share == 0.0:
        return "-kd dq"
    return "kd (dq_ref - dq)" if share == 1.0 else f"kd ({share:.3g} dq_ref - dq)"


def _plain(values: np.ndarray) -> float | list[float]:
    """Gains as the file has them: one number where all joints share it."""
    listed = [float(f"{x:.10g}") for x in np.asarray(values, float)]
    return listed[0] if len(set(listed)) == 1 else listed


def _finding(severity: Severity, message: str, step: str, key: str, value: Any) -> Finding:
    """A key of the table ``[controller]`` that is another one than the file's; None: too much."""
    place = ("controller", key)
    repairs = [Repair((Edit(place, value),))]
    return ACTUATORS.finding(severity, message, "", step, place=place, repairs=repairs)
