"""The declared control law beside that of the robot's own actuators.

Position actuators of an MJCF are kp (q_ref - q) - kd dq: they damp the speed itself, a PD law the
speed of the error. A law of the wrong form is fitted by joints with its gain on speed as damping.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from pivident.check.gains_check import of_joint
from pivident.check.remark import Remark
from pivident.errors import PividentError
from pivident.experiment.schema import ControllerEntry
from pivident.recording.recording import Recording
from pivident.robot.description import Robot
from pivident.robot.mjcf_actuators import ActuatorLaw, actuator_law
from pivident.robot.naming import MJCF_FILES
from pivident.simulation.controllers import UNKNOWN_GAIN
from pivident.text.finding import Severity

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
) -> list[Remark]:
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
    file, names = Path(robot.description).name, robot.joint_names
    if not law.kp.any():
        return []
    if law.reasons:
        return [_remark("note", f"Not all actuators of {file} hold a position: {law.reasons[0]}.")]
    with_speeds = any(run.dq_ref is not None for run in recordings)
    n, share = len(names), law.speed_feed_forward(with_speeds)
    gain = np.array([of_joint(entry.gain, j) for j in range(n)])
    kp = gain * [of_joint(entry.kp, j) for j in range(n)]
    kd = gain * [of_joint(entry.kd if entry.kv is None else entry.kv, j) for j in range(n)]
    right = {"kp": law.kp, "kd": law.kd}
    if entry.type == "cascade":
        kp, right = kp * kd / gain, {"kp": law.kp / np.where(law.kd, law.kd, np.inf), "kv": law.kd}
    remarks = []
    if share is not None and abs(entry.feed_forward_share - share) > EQUAL and (kd * law.kd).any():
        said = _form(entry.feed_forward_share)
        remarks.append(
            _remark(
                "warning",
                f"The law under [controller] damps by {said}, the actuators of {file} by "
                f"{_form(share)}: the difference is found as damping of the joints.",
                f"If the log is of these actuators, write speed_feed_forward = {share:g}.",
                "speed_feed_forward",
            )
        )
    for (key, values), declared, of_file in zip(
        right.items(), (kp, kd), (law.kp, law.kd), strict=True
    ):
        off = np.flatnonzero(np.abs(declared - of_file) > EQUAL * np.maximum(of_file, declared))
        if not off.size:
            continue
        product = "kp kv" if entry.type == "cascade" and key == "kp" else key
        listed = ", ".join(f"{names[j]} {declared[j]:.5g} (file: {of_file[j]:.5g})" for j in off)
        remarks.append(
            _remark(
                "warning",
                f"{product} under [controller], drive gain included, differs from the actuators of "
                f"{file}: {listed}.",
                f"If the log is of these actuators, write {key} = {_plain(values / gain)}; gains "
                "of other drives stay as they are.",
                key,
            )
        )
    if entry.ki is not None and np.any(entry.ki):
        text = f"The law under [controller] has an integrator, the actuators of {file} have none."
        step = "If the log is of these actuators, leave ki out."
        remarks.append(_remark("warning", text, step, "ki"))
    if entry.limit is None and np.isfinite(law.limit).all():
        text = f"The actuators of {file} have limits, and [controller] declares none."
        step = f"If the log is of these actuators, write limit = {_plain(law.limit / gain)}."
        remarks.append(_remark("note", text, step, "limit"))
    return [*remarks, *_beyond(law, recordings, robot, file)]


def _beyond(
    law: ActuatorLaw, recordings: Sequence[Recording], robot: Robot, file: str
) -> list[Remark]:
    """References that the actuators would cut off."""
    remarks = []
    for run in recordings:
        for j, (low, high) in enumerate(law.reach if run.q_ref is not None else ()):
            q_ref = run.q_ref[:, j]  # type: ignore[index]
            room = EQUAL * (high - low)
            if np.isfinite(room) and (q_ref.min() < low - room or q_ref.max() > high + room):
                unit = robot.joints[j].position_unit
                text = (
                    f"The reference of {robot.joint_names[j]} goes from {q_ref.min():.4g} to "
                    f"{q_ref.max():.4g} {unit}, but ctrlrange of its actuator in {file} ends at "
                    f"{low:.4g} and {high:.4g} {unit}."
                )
                step = "MuJoCo cuts it off there; check the unit of q_ref, or log what is applied."
                remarks.append(_remark("warning", text, step, "type", robot.joint_names[j]))
    return remarks


def _form(share: float) -> str:
    """What a gain on speed acts on, as a formula."""
    if share == 0.0:
        return "-kd dq"
    return "kd (dq_ref - dq)" if share == 1.0 else f"kd ({share:.3g} dq_ref - dq)"


def _plain(values: np.ndarray) -> float | list[float]:
    """Gains as the file has them: one number where all joints share it."""
    listed = [float(f"{x:.10g}") for x in np.asarray(values, float)]
    return listed[0] if len(set(listed)) == 1 else listed


def _remark(
    severity: Severity, message: str, step: str = "", key: str = "type", joint: str = ""
) -> Remark:
    place = ("controller", key)
    return Remark(severity, "controller", "actuators", message, joint, step, place=place)
