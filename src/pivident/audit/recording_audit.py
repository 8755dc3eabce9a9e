"""What an audit has against recordings whose estimate is to be believed.

A recording is checked where it is made, channel by channel. Here its channels are asked about one
another: whether samples are lost, whether angles are in their unit, whether each torque belongs to
its joint, with this sign, in this scale and at this instant, and whether a vertical slide carries
its weight. Loads and excitation are left out, since an estimate says more about them, and so are
the masses of the description where a torque has another shape than theirs.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pivident.audit.delay import check_delay
from pivident.audit.inverse_model import InverseModel, build_inverse_model
from pivident.audit.order import check_order
from pivident.audit.power import check_power
from pivident.audit.saturation import check_channels
from pivident.audit.scale import ALIKE, another_position_unit, check_scale
from pivident.audit.timing import check_timing
from pivident.errors import PividentError
from pivident.logs.log import Log
from pivident.recording.recording import Recording
from pivident.robot.description import Robot
from pivident.text.finding import Finding, gravest_first, serious
from pivident.threads import linear_algebra_in_one_thread

#: Kinds of findings that are a reservation about every estimate, by topic; empty: all of them.
KINDS: dict[str, tuple[str, ...]] = {
    "timing": ("lost", "repeated", "hidden jitter"),
    "channels": ("spike", "stuck", "frozen", "wrapped", "clipped"),
    "order": (),
    "delay": (),
    "power": ("sign", "weight"),
    "scale": ("angle unit", "joint angle unit", "gain"),
}


def recording_faults(robot: Robot, recordings: Sequence[Recording]) -> tuple[Finding, ...]:
    """Warnings and errors of an audit about recordings, the gravest first.

    Args:
        robot: the robot.
        recordings: runs of it. What several of them share is said once, with their names.
    """
    found: dict[tuple[str, ...], list[tuple[Recording, Finding]]] = {}
    with linear_algebra_in_one_thread():
        for recording in recordings:
            for finding in _faults(robot, recording):
                key = (finding.topic, finding.kind, finding.subject)
                found.setdefault(key, []).append((recording, finding))
    return tuple(gravest_first(_together(own, len(recordings) > 1) for own in found.values()))


def _together(own: Sequence[tuple[Recording, Finding]], several: bool) -> Finding:
    """One fault of some recordings: the gravest, and where it is."""
    gravest = gravest_first(finding for _, finding in own)[0]
    if not several:
        return gravest
    names = ", ".join(recording.name for recording, _ in own)
    return replace(gravest, message=f"{names}: {gravest.message}")


def _faults(robot: Robot, recording: Recording) -> list[Finding]:
    """Warnings and errors about one recording; each fault is made good for the next check."""
    log = log_of(robot, recording)
    timing = check_timing(log)
    findings = [*timing.findings, *map(_allowed, check_channels(log))]
    if not recording.has_torque:  # one from the control law fits the motion whatever is wrong
        return serious(f for f in findings if _is_reservation(f))
    try:
        model = build_inverse_model(log, timing).delayed(-recording.drive_delay)
        if (another := another_position_unit(log, model)) is not None:
            finding, model = another
            findings.append(finding)
        order = check_order(model)
        if any(f.severity == "error" for f in order.findings):
            model = model.reordered(order.torque_of)
        delay = check_delay(log, model)
        if np.isfinite(delay.common[0]):
            model = model.delayed(delay.common[0])
        power = check_power(log, model)
        findings += [*order.findings, *delay.findings, *power.findings]
        if not serious([*order.findings, *power.findings]):  # they spoil the factors
            findings += _gains(log, model, power.right)
    except (PividentError, np.linalg.LinAlgError):
        pass  # too short to compare torque and motion, for example: nothing is said of them
    return serious(f for f in findings if _is_reservation(f))


def _allowed(finding: Finding) -> Finding:
    """A torque that is cut off is in a recording because somebody allowed it."""
    is_cut = finding.kind == "clipped" and finding.severity == "error"
    return replace(finding, severity="warning") if is_cut else finding


def _gains(log: Log, model: InverseModel, signs_right: Sequence[int]) -> list[Finding]:
    """Joints whose torque is that of the description but for a factor: a reservation at most.

    A torque of another shape speaks of wrong masses, which an estimate replaces. So may a factor,
    which is then no fault of the log.
    """
    found = check_scale(log, model, signs_right)
    alike = dict(zip(model.robot.joint_names, np.abs(found.likeness) >= ALIKE, strict=True))
    gains = serious(f for f in found.findings if f.kind == "gain" and alike[f.subject])
    return [replace(f, severity="warning") for f in gains]


def log_of(robot: Robot, recording: Recording) -> Log:
    """A recording as the log of positions and torques that it was made from."""
    channels = {"q": recording.q}
    if recording.has_torque:
        channels["tau"] = recording.tau
    return Log(
        recording.name,
        robot.joint_names,
        {},
        {},
        recording.rate,
        channels,
        channels,
        robot,
        recording.torque_timing,
        recording.control_rate,
        recording.delay,
        torque_scale=recording.torque_scale,
    )


def _is_reservation(finding: Finding) -> bool:
    """Whether a finding is about every estimate; a torque jumps where dry friction turns."""
    kinds = KINDS.get(finding.topic)
    if kinds is None or (finding.kind == "spike" and finding.subject.startswith("tau ")):
        return False
    return not kinds or finding.kind in kinds
