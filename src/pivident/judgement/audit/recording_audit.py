"""What an audit has against recordings whose estimate is to be believed.

A recording is checked where it is made, channel by channel. Here its channels are asked about one
another: whether samples are lost, whether angles are in their unit, whether each torque belongs to
its joint, with this sign, in this scale and at this instant, and whether a vertical slide carries
its weight. Loads and excitation are left out, since an estimate says more about them, and so are
the masses of the description where a torque has another shape than theirs.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import replace

import numpy as np

from pivident.data.logs.log import Log
from pivident.data.recording.recording import Recording
from pivident.foundation.common_work import once
from pivident.foundation.errors import PividentError
from pivident.foundation.text.finding import Finding, gravest_first, serious
from pivident.foundation.threads import linear_algebra_in_one_thread
from pivident.judgement.audit.examination import Examination, LogCheck, in_turn
from pivident.judgement.audit.inverse_model import InverseModel, build_inverse_model
from pivident.judgement.audit.log_checks import CHECKS
from pivident.judgement.audit.saturation import CLIPPED, check_channels
from pivident.judgement.audit.scale import ALIKE, GAIN, LOAD, PositionUnitCheck, check_scale
from pivident.judgement.audit.standstill import check_rest_at_ends
from pivident.judgement.audit.timing import Timing, check_timing
from pivident.robot.description import Robot


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
    """Warnings and errors about one recording."""
    log = log_of(robot, recording)
    timing = check_timing(log)
    # what keeps filters from ringing where samples are left out is nothing that was measured
    valid = True if recording.valid is None else recording.valid
    measured = {name: np.where(valid, x, np.nan) for name, x in log.logged.items() if name == "tau"}
    seen = replace(log, logged=log.logged | measured)
    findings = [*timing.findings, *map(_allowed, check_channels(seen))]
    findings += check_rest_at_ends(recording.q, recording.t)
    if recording.has_torque:  # one from the control law fits the motion whatever is wrong
        findings += _against_torque(robot, recording, log, timing)
    return serious(finding for finding in findings if finding.is_reservation)


def _against_torque(
    robot: Robot, recording: Recording, log: Log, timing: Timing
) -> tuple[Finding, ...]:
    """What torque and motion say about each other, as far as they can be compared."""
    findings: tuple[Finding, ...] = ()
    with suppress(PividentError, np.linalg.LinAlgError):  # too short, for example
        seen = Examination(log, timing, recording_model(robot, recording, log, timing))
        for check in _checks():
            seen = in_turn(seen, [check])
            findings = seen.findings
    return findings


def _checks() -> Iterator[LogCheck]:
    """The checks of an audit, but for what an estimate says more about."""
    yield PositionUnitCheck(one_by_one=False)  # a search asks for those of single joints
    yield from (CHECKS[name] for name in ("order", "delay", "gravity", "power"))
    yield GainsCheck()
    yield from (check for name, check in CHECKS.usable().items() if name in CHECKS.foreign)


def _allowed(finding: Finding) -> Finding:
    """A torque that is cut off is in a recording because somebody allowed it: no repair is left.

    As one that is tried, and changes nothing, it would take the finding along.
    """
    is_cut = finding.declared is CLIPPED
    return replace(finding, severity="warning", repairs=()) if is_cut else finding


class GainsCheck(LogCheck):
    """Joints whose torque is that of the description but for a factor or a load: a reservation.

    A torque of another shape speaks of wrong masses, which an estimate replaces. So may a factor,
    which is then no fault of the log. Wrong orders and signs spoil all factors.
    """

    name = "factors"

    def examine(self, seen: Examination) -> Examination:
        """See `LogCheck.examine`."""
        if serious(seen.of("order", "power")):
            return seen
        scale = check_scale(seen.log, seen.model, seen.results["power"].right)
        alike = np.abs(scale.likeness) >= ALIKE
        same_shape = dict(zip(seen.model.robot.joint_names, alike, strict=True))
        kept = (
            f
            for f in scale.findings
            if f.declared is LOAD or (f.declared is GAIN and same_shape[f.subject])
        )
        return seen.after(self.name, [replace(f, severity="warning") for f in serious(kept)], scale)


def recording_model(
    robot: Robot, recording: Recording, log: Log | None = None, timing: Timing | None = None
) -> InverseModel:
    """Rows of the inverse model of a recording, at the instants of its torque.

    ``log`` and ``timing``: of the recording, where they are at hand.

    Raises:
        RecordingError: it is too short for that.
    """

    def make() -> InverseModel:
        own = log or log_of(robot, recording)
        return build_inverse_model(own, timing or check_timing(own))

    return once(("inverse model", robot, recording), make).delayed(-recording.drive_delay)


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
