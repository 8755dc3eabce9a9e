"""One log of an experiment: names of columns, audit, motion, reference and gains.

It is read strictly, as an identification reads it, and forgivingly, as an audit does. What the
strict reading refuses does not stop what can still be looked at: a log with gaps is looked at in
the stretches between them.

The reference against the log: whether it is one, of the same joints, in the same unit.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from pivident.data.logs.file_columns import read_columns
from pivident.data.logs.log import Log
from pivident.data.logs.timestamps import LOWEST_RATE
from pivident.data.recording.recording import Recording
from pivident.data.recording.usable_samples import filled
from pivident.dynamics.base_parameters import base_parameters
from pivident.experiment.check.columns_check import check_columns, check_unnamed_torque
from pivident.experiment.check.gains_check import check_gains, check_limit
from pivident.experiment.check.geometry_check import GeometryCheck, check_gravity
from pivident.experiment.check.motion_check import check_motion
from pivident.experiment.check.remark import Remark, of_error, of_finding, usable_rows
from pivident.experiment.check.torque_side import TorqueSideCheck
from pivident.experiment.file_keys import ControllerEntry, RecordingEntry
from pivident.experiment.recording_tables import columns_in_file, log_of, run_of
from pivident.foundation.errors import (
    BadCell,
    BrokenMotion,
    GapInClock,
    MissingSamples,
    PividentError,
)
from pivident.foundation.files import named_file
from pivident.foundation.text.finding import Finding, FindingKind, Quantity, Topic
from pivident.foundation.text.repair import Place, Reordered, Repair, Reversed, in_unit, setting
from pivident.judgement.audit.audit import NO_TORQUE, Audit, audit_log
from pivident.judgement.audit.examination import Examination, in_turn
from pivident.judgement.audit.timing import MISSING_SAMPLES, NO_CLOCK, RATE, Timing, check_timing
from pivident.robot.description import Robot

#: What this check finds by itself.
LONG_DELAY = FindingKind(Topic("timing"), "delay", ("recording", "delay"))

#: A declared delay beyond this is in milliseconds [s].
MAX_DELAY = 0.5

#: Lines up to which a line of another length means that the whole table is something else.
EARLY = 3


@dataclass(frozen=True, eq=False)
class CheckedLog:
    """What was found out about one log."""

    remarks: tuple[Remark, ...]  # what is wrong with it
    recordings: tuple[Recording, ...] = ()  # as read, or the stretches between gaps
    audit: Audit | None = None  # the audit, where it can be read at all
    looked_at: str = ""  # what was checked, in words


def check_log(
    entry: RecordingEntry,
    place: Place,
    robot: Robot | None,
    folder: Path,
    controller: ControllerEntry | None,
) -> CheckedLog:
    """Everything about one log."""
    remarks: list[Remark] = []
    if entry.columns is not None:
        columns = entry.columns.model_dump(exclude_unset=True)
        units = entry.units.model_dump(exclude_unset=True)
        remarks += _placed(check_columns(columns, units, robot), place)
    recordings, failure = _recordings(entry, robot, folder)
    try:
        log = log_of(entry, robot, folder)
    except PividentError as error:
        remarks.append(of_error(failure or error, "recording", place))
        return CheckedLog(tuple(remarks), recordings)
    if isinstance(failure, BadCell) and failure.column is None and failure.line <= EARLY:
        remarks.append(of_error(failure, "recording", place))
        return CheckedLog(tuple(remarks))  # the columns are not what they are called
    audit = audit_log(log)
    # that there is no torque concerns the control law, which is looked at later
    grave = [f for f in audit.findings if f.severity != "ok" and f.declared is not NO_TORQUE]
    refused = failure if not recordings else None
    same = said_by(refused, grave)
    if refused is not None and not any(finding.severity == "error" for finding in same):
        is_missing = isinstance(refused, (MissingSamples, GapInClock))
        kind = MISSING_SAMPLES.name if is_missing else "refused"
        remarks.append(of_error(refused, "recording", place, kind))
        same = []
    remarks += [of_finding(finding, place, finding in same) for finding in grave]
    if audit.model is not None:
        seen = Examination(log, audit.timing, audit.model, audit.findings)
        checks = (GeometryCheck(), TorqueSideCheck(entry.torque_side or "motor"))
        further = in_turn(seen, checks).findings[len(audit.findings) :]
        remarks += _placed(further, place)
    slow = entry.rate is not None and entry.rate < LOWEST_RATE
    if entry.delay is not None and abs(entry.delay) > MAX_DELAY:
        leaves = audit.timing.rate and abs(entry.delay) * audit.timing.rate >= log.samples
        remarks.append(of_finding(_long_delay(entry.delay), place, bool(leaves)))
    if not slow and not any(f.declared in (RATE, NO_CLOCK) for f in audit.findings):
        # a motion with holes would jump over them
        whole = {key: filled(values, key != "tau") for key, values in log.channels.items()}
        every = _with_other_columns(replace(log, channels=whole), entry, folder)
        stretch, timing = _without_gaps(every, audit.timing, failure)
        has_inputs = entry.columns is not None and bool(entry.columns.inputs)
        if entry.columns is not None:
            named = entry.columns.model_dump(exclude_unset=True)
            remarks += _placed(check_unnamed_torque(named, every.columns), place)
        remarks += _placed(_motion(stretch, timing, audit, controller, has_inputs), place)
    looked_at = _looked_at(log, audit, entry) if robot is not None or not remarks else ""
    return CheckedLog(tuple(remarks), recordings, audit, looked_at)


def _recordings(
    entry: RecordingEntry, robot: Robot | None, folder: Path
) -> tuple[tuple[Recording, ...], PividentError | None]:
    """A log as an identification reads it, or between its gaps, and what such a reading says."""
    if robot is None:
        return (), None
    try:
        return run_of(entry, robot, folder)
    except (MissingSamples, GapInClock, BrokenMotion) as gap:
        try:  # what the plan is going to be once the short gaps are filled
            return run_of(entry.model_copy(update={"resample": True}), robot, folder)[0], gap
        except PividentError:
            return (), gap
    except PividentError as error:
        return (), error


def _without_gaps(log: Log, timing: Timing, failure: PividentError | None) -> tuple[Log, Timing]:
    """The longest stretch without a gap, whose clock is regular; else the log as it is."""
    gaps = (MissingSamples, GapInClock, BrokenMotion)
    if not isinstance(failure, gaps) or len(failure.stretches.parts) < 2:
        return log, timing
    longest = log.between(*failure.stretches.longest)
    return longest, check_timing(longest)


def _with_other_columns(log: Log, entry: RecordingEntry, folder: Path) -> Log:
    """The log with the columns of its file that the experiment does not use."""
    if not isinstance(entry.files, str) or entry.columns is None:
        return log
    try:
        used = str(columns_in_file(entry, folder))
        every = read_columns(named_file(folder, entry.files))
    except PividentError:
        return log
    every = {n: log.rows_kept(x) for n, x in every.items()}
    rest = {n: x for n, x in every.items() if repr(n) not in used and len(x) == log.samples}
    return replace(log, columns=rest)


def _placed(findings: Iterable[Finding], table: Place) -> list[Remark]:
    """Findings about a log as remarks about the table of its recording."""
    return [of_finding(finding, table) for finding in findings]


def _motion(
    log: Log,
    timing: Timing,
    audit: Audit,
    controller: ControllerEntry | None,
    has_inputs: bool,
) -> list[Finding]:
    """What the channels say about one another, and about the controller."""
    parameters = 0 if log.robot is None else len(base_parameters(log.robot))
    findings = [*check_motion(log, timing, parameters), *check_reference(log)]
    if controller is None:
        return findings
    is_wrong = any(finding.severity == "error" for finding in findings)
    is_wrong |= any(finding.spoils("gains") for finding in audit.findings)
    findings += check_limit(log, controller)
    if controller.kp is not None and not is_wrong:
        reversed_joints = () if audit.power is None else audit.power.reversed
        findings += check_gains(log, timing, controller, reversed_joints)
        if not has_inputs:
            findings += check_gravity(log, timing, controller)
    return findings


def _looked_at(log: Log, audit: Audit, entry: RecordingEntry) -> str:
    """What was checked of one log, in words."""
    name = log.name if entry.part is None else f"{log.name} ({entry.part[0]:.13g} s on)"
    rate = f" at {audit.timing.rate:.6g} Hz" if audit.timing.rate else ""
    judged = "" if audit.model is None else ", signs, gains, delay, excitation"
    return f"{name}: {log.samples} samples{rate}; clock, gaps, units, columns, limits{judged}"


def _long_delay(delay: float) -> Finding:
    """A declared delay that no logger has."""
    text = f"The torque is declared to be {delay:g} s late."
    step = f"delay is in seconds; {delay:g} ms are {1e-3 * delay:g}."
    seconds = float(f"{1e-3 * delay:.6g}")
    repairs = [setting("delay", value=seconds, words="It is in milliseconds.")]
    return LONG_DELAY.finding("error", text, "tau", step, repairs=repairs)


def said_by(error: PividentError | None, findings: Sequence[Finding]) -> list[Finding]:
    """Findings that say the same as an error of the reader, by the nearest class that any names."""
    for kind in type(error).__mro__:
        same = [f for f in findings if f.declared is not None and kind in f.declared.reports]
        if same:
            return same
    return []


#: What this check looks at, and the columns of the reference.
REFERENCE, COLUMNS = Topic("reference"), ("recording", "columns", "q_ref")

COPY = FindingKind(REFERENCE, "copy", COLUMNS)
CONSTANT = FindingKind(REFERENCE, "constant", COLUMNS)
OFFSET = FindingKind(REFERENCE, "offset", COLUMNS)
ORDER = FindingKind(REFERENCE, "order", COLUMNS)
UNIT = FindingKind(REFERENCE, "unit", ("recording", "units", "q_ref"))
SPEED = FindingKind(REFERENCE, "speed")
FAR = FindingKind(REFERENCE, "far", COLUMNS)

#: Distance between reference and position, relative to the motion, that is plausible.
CLOSE = 0.25

#: Share of the variance that another reading of the reference must explain.
ALIKE = 0.97

#: Travel below which a joint's reference is not judged [rad or m].
MOTION = 0.05


def check_reference(log: Log) -> list[Finding]:
    """Whether the reference is one: of the same joints, in the same unit, before the position."""
    if "q_ref" not in log.channels or "q" not in log.channels:
        return []
    q, q_ref = log.channels["q"], log.channels["q_ref"]
    if q.shape != q_ref.shape:
        return []
    rows = usable_rows(q, q_ref)
    if len(rows) < 50:
        return []
    return [*_reference(log, q[rows], q_ref[rows])]


def _reference(log: Log, q: np.ndarray, q_ref: np.ndarray) -> Iterator[Finding]:
    names = log.joint_names
    distance = np.std(q_ref - q, axis=0) / np.maximum(np.std(q, axis=0), 1e-12)
    copies = [names[j] for j in range(q.shape[1]) if np.array_equal(q[:, j], q_ref[:, j])]
    if copies:
        text = f"The reference of {', '.join(copies)} is the measured position itself."
        advice = (
            "Name the column of the setpoint; without one leave q_ref out and set "
            'reference = "reconstruct".'
        )
        yield COPY.finding("error", text, copies[0], advice)
        return
    for j, name in enumerate(names[: q.shape[1]]):
        if np.std(q_ref[:, j]) == 0 and np.std(q[:, j]) > 0:
            text = f"The reference of {name} never changes, but {name} moves."
            advice = "Name the column of this joint's setpoint."
            yield CONSTANT.finding("error", text, name, advice)
            return
    far = [j for j in range(q.shape[1]) if distance[j] > CLOSE and np.ptp(q[:, j]) > MOTION]
    if not far:
        moving = np.ptp(q, axis=0) > MOTION
        apart = moving * np.abs(np.mean(q_ref - q, axis=0)) / np.maximum(np.ptp(q, axis=0), MOTION)
        for j in np.flatnonzero(apart > 0.1).tolist():
            offset = Quantity(float(np.mean(q_ref - q, axis=0)[j]), log.position_unit(j))
            yield OFFSET.finding(
                "warning",
                f"The reference of {names[j]} lies {offset.value:.4g} {offset.unit} away from the "
                "position throughout.",
                names[j],
                "Their zeros differ; correct one of them in the log.",
                {"offset": offset},
            )
        return
    fit = np.abs(_correlations(q, q_ref))
    best = fit.argmax(axis=1)
    swapped = [j for j in far if best[j] != j and fit[j, best[j]] ** 2 > ALIKE]
    if swapped:
        pairs = ", ".join(f"{names[j]} follows the reference of {names[best[j]]}" for j in swapped)
        text = f"The columns of q and q_ref are in different orders: {pairs}."
        advice = "List both in the order of the robot's joints."
        order = tuple(int(best[j]) if j in swapped else j for j in range(q.shape[1]))
        repairs = [Repair((Reordered(channel="q_ref", order=order),))]
        yield ORDER.finding("error", text, names[swapped[0]], advice, repairs=repairs)
        return
    for j in far:
        signed = _correlations(q[:, [j]], q_ref[:, [j]])[0, 0]
        factor = signed * float(np.std(q_ref[:, j]) / np.std(q[:, j]))
        if signed**2 > ALIKE:
            cause, step = f"{factor:.4g} times the position", "Check the units of q and q_ref."
            repairs = list[Repair]()
            if signed < 0:
                step = "One of the two has the wrong sign; correct it in the log."
                repairs = [Repair((Reversed(channel="q_ref", joints=(names[j],)),))]
            elif 0.9 < factor * np.pi / 180 < 1.1:
                step = 'It seems to be in degrees: set units = {q_ref = "deg"}.'
                repairs = [in_unit("q_ref", "deg")]
            elif 0.9 < factor * 180 / np.pi < 1.1:
                step = 'The positions seem to be in degrees: set units = {q = "deg"}.'
                repairs = [in_unit("q", "deg")]
            text = f"The reference of {names[j]} is {cause}."
            evidence = {"factor": Quantity(factor)}
            yield UNIT.finding("error", text, names[j], step, evidence, repairs=repairs)
            continue
        speed_of_ref = abs(_correlations(q[:, [j]], np.gradient(q_ref[:, [j]], axis=0))[0, 0])
        speed_of_q = abs(_correlations(q_ref[:, [j]], np.gradient(q[:, [j]], axis=0))[0, 0])
        if max(speed_of_ref, speed_of_q) ** 2 > 0.9:
            which, other = ("q", "q_ref") if speed_of_ref > speed_of_q else ("q_ref", "q")
            text = f"{which} of {names[j]} is the derivative of {other}: it holds a speed."
            advice = f"Name the column of the position for {which}."
            place = (*COLUMNS[:-1], which)
            yield SPEED.finding("error", text, names[j], advice, place=place)
            continue
        yield FAR.finding(
            "warning",
            f"{names[j]} does not follow its reference: they differ by {100 * distance[j]:.3g} % "
            "of the motion.",
            names[j],
            "Another column, another joint, or a reference in another frame; IV and PIV simulate "
            "the loop along it.",
            {"distance": Quantity(100 * float(distance[j]), "%", digits=3)},
        )


def _correlations(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Correlation of every column of x with every column of y."""
    x, y = x - x.mean(axis=0), y - y.mean(axis=0)
    size = np.outer(np.linalg.norm(x, axis=0), np.linalg.norm(y, axis=0))
    return (x.T @ y) / np.where(size > 0, size, 1.0)
