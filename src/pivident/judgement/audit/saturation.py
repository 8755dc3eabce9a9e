"""Single channels: what is missing, cut off, constant, stuck, wrapped around or an outlier."""

from __future__ import annotations

import math

import numpy as np

from pivident.data.logs.bad_samples import TOLERATED
from pivident.data.logs.log import Log
from pivident.data.logs.misplaced_positions import cuts
from pivident.data.recording.checks import TOLERATED_CLIPPING, clipped_samples
from pivident.data.recording.usable_samples import left_out
from pivident.foundation.errors import ConstantChannel, NonFiniteSamples, SaturatedSignal
from pivident.foundation.text.finding import Finding, FindingKind, Quantity, Severity, at_sample
from pivident.foundation.text.repair import LeftOut, Repair, setting
from pivident.judgement.audit.quantisation import CHANNELS, check_frozen
from pivident.judgement.audit.spoilt_checks import COMPARISONS, GEOMETRY

#: Tables and keys of the part that is used, and of the positions.
PART, POSITIONS = ("recording", "part"), ("recording", "columns", "q")

ROWS_LEFT_OUT = FindingKind(CHANNELS, "rows left out")
BREAK = FindingKind(CHANNELS, "break", PART)
MISSING = FindingKind(CHANNELS, "missing", spoils=GEOMETRY, reports=(NonFiniteSamples,))
CONSTANT = FindingKind(CHANNELS, "constant", spoils=COMPARISONS, reports=(ConstantChannel,))
SPIKE_OF_MOTION = FindingKind(CHANNELS, "spike", reservation=True)
#: Torques jump where dry friction turns, so that theirs is none about every estimate.
SPIKE_OF_TORQUE = FindingKind(CHANNELS, "spike")
CLIPPED = FindingKind(
    CHANNELS,
    "clipped",
    ("recording", "saturation"),
    reservation=True,
    spoils=COMPARISONS,
    reports=(SaturatedSignal,),
)
STUCK = FindingKind(CHANNELS, "stuck", reservation=True, spoils=COMPARISONS)
WRAPPED = FindingKind(CHANNELS, "wrapped", POSITIONS, reservation=True)

#: Repairs that take a log as it is.
ACCEPT_CUT_OFF = setting(
    "saturation", value="allow", words='Accept the torques that are cut off: saturation = "allow".'
)
ACCEPT_CONSTANT = setting(
    "allow_constant",
    value=True,
    words="Accept joints that do not move: allow_constant = true.",
)

#: A spike stands out of its neighbourhood by so many of its standard deviations.
SPIKE = 12.0

#: Spread of the share of one neighbour from which on stamps tremble, and the share of a sample by
#: which a single one may then be wrong.
TREMBLING, STAMP = 0.005, 0.25

#: Samples on each side that make up the neighbourhood.
NEIGHBOURS = 15

#: Share of the usual range below which a logged speed has no spike: a single count makes one.
LEAST_SPEED = 0.2

#: Steps of a position up to so many times the smallest are one count of its encoder.
ONE_STEP = 1.5

#: Step of a position below which its joint stands, as share of its fastest ones.
SLOW = 0.02

#: Share of the samples that one value of a torque may have while its joint moves.
ONE_VALUE = 0.5


def check_channels(log: Log) -> tuple[Finding, ...]:
    """Judge each signal by itself."""
    findings = [*_no_measurements(log), *_breaks(log)]
    for name, values in log.signals().items():
        findings += _missing(log, name, values)
        finite = np.flatnonzero(np.isfinite(values))
        x = values[finite]
        if x.size < 5:
            continue
        if np.ptp(x) == 0:
            findings.append(_constant(name, float(x[0])))
            continue
        kind, _, joint = name.partition(" of ")
        q = None
        if kind in ("tau", "dq") and "q" in log.logged and joint in log.joint_names:
            q = log.logged["q"][finite, log.joint_names.index(joint)]
        if kind == "tau" and q is not None:
            judged = _clipped(log, name, x, q, finite) or _one_value(name, x, q)
            findings += judged or check_frozen(log, name, x, q, finite)
        elif kind == "q":
            findings += _wrapped(log, name, x, finite)
        findings += _spikes(log, name, x, finite, q)
    return tuple(findings)


def _no_measurements(log: Log) -> list[Finding]:
    """Rows that were left out, and samples that are no measurement but are there."""
    step = "Check the logger."
    findings = [ROWS_LEFT_OUT.finding("warning", text, "the log", step) for text in log.dropped]
    for fault in log.bad:
        if fault.kind == "missing":
            continue
        first, number = int(fault.rows[0]), len(fault.rows)
        text = f"{left_out(fault, log.joint_names, log.samples)}."
        step = "They are left out of the equations; check the logger."
        evidence = {"samples": Quantity(float(number)), **at_sample(first, log.time_of(first))}
        name = fault.name(log.joint_names)
        many = number > TOLERATED * log.samples
        severity: Severity = "error" if many else "warning"
        kind = FindingKind(CHANNELS, fault.kind)
        findings.append(kind.finding(severity, text, name, step, evidence))
    return findings


def _breaks(log: Log) -> list[Finding]:
    """Places at which the positions jump and do not come back."""
    at = cuts(log.logged["q"], log.clock) if "q" in log.logged else np.empty(0, int)
    if not at.size:
        return []
    first = int(at[0])
    text = f"The positions jump in {at.size} place(s) and do not come back, first at sample {first}"
    text += f" (t = {log.time_of(first):.6g} s)." if log.time_of(first) is not None else "."
    step = "Rows were lost or logged twice. The stretches before and behind are used separately."
    evidence = {"breaks": Quantity(float(at.size)), **at_sample(first, log.time_of(first))}
    return [BREAK.finding("warning", text, "q", step, evidence)]


def _missing(log: Log, name: str, values: np.ndarray) -> list[Finding]:
    missing = ~np.isfinite(values)
    faults = [f for f in log.bad if not f.channel or f.name(log.joint_names) == name]
    for fault in faults:
        if fault.kind != "missing":
            missing[fault.rows[fault.rows < len(missing)]] = False
    bad = np.flatnonzero(missing)
    if not bad.size:
        return []
    text = (
        f"{name} has {bad.size} sample(s) that are empty, NaN or infinite, the first at "
        f"sample {bad[0]}."
    )
    left_out_here = bool(faults) and bad.size <= TOLERATED * len(values)
    step = "Cut the recording there, or repair the log."
    if left_out_here:
        step = "They are left out of the equations; repair the log where they matter."
    severity: Severity = "warning" if left_out_here else "error"
    evidence = {
        "missing": Quantity(float(bad.size), "samples"),
        **at_sample(int(bad[0]), log.time_of(int(bad[0]))),
    }
    return [MISSING.finding(severity, text, name, step, evidence)]


def _constant(name: str, value: float) -> Finding:
    channel, _, joint = name.partition(" of ")
    severity: Severity = "error" if channel in ("q", "tau") else "ok"
    step = "Check its column, or freeze that joint and leave it out." if severity == "error" else ""
    text = f"{name} is {value:.6g} at every sample."
    at = LeftOut(at=((joint, float(f"{value:.6g}")),))
    return CONSTANT.finding(
        severity,
        text,
        name,
        step,
        {"value": Quantity(value)},
        repairs=(Repair((at,)), ACCEPT_CONSTANT) if severity == "error" else (),
    )


def _weights(log: Log, place: np.ndarray) -> np.ndarray:
    """Share of the sample before in the value between two neighbours, by the stamps of all three.

    One half on a regular clock, and where the stamps say nothing.
    """
    t, half = log.clock, np.full(place.size - 2, 0.5)
    if t is None or len(t) != log.samples:
        return half
    before, after = np.diff(t[place])[:-1], np.diff(t[place])[1:]
    known = np.isfinite(before + after) & (before > 0.0) & (after > 0.0)
    return np.divide(after, before + after, out=half, where=known)


def _spikes(
    log: Log, name: str, x: np.ndarray, place: np.ndarray, q: np.ndarray | None
) -> list[Finding]:
    """Single samples of height A with second difference (-A/2, A, -A/2), unlike a step.

    Where the joint of a torque, at ``q``, turns round or stops for a moment, dry friction changes
    from one sample to the next, by the whole range where friction is all of it; only more is a
    spike there. Where an encoder has moved by one count, the speed of a drive shows that count.
    Where stamps tremble, a value that is right a fraction of a sample earlier or later is none.
    """
    if x.size < 4 * NEIGHBOURS:
        return []
    before = _weights(log, place)
    second = x[1:-1] - (before * x[:-2] + (1.0 - before) * x[2:])
    height = np.abs(second[1:-1])
    tolerated = STAMP * 0.5 * np.abs(x[3:-1] - x[1:-3]) if np.std(before) > TREMBLING else 0.0
    sides = np.maximum(
        np.abs(second[:-2] + 0.5 * second[1:-1]), np.abs(second[2:] + 0.5 * second[1:-1])
    )
    usual = 1.4826 * float(np.median(np.abs(second - np.median(second))))
    if usual == 0.0:
        return []  # a channel of steps: each step looks like a spike
    usual = max(
        usual, 0.3 * float(np.std(second[np.abs(second) <= np.quantile(abs(second), 0.99)]))
    )
    spikes = []
    kind = name.partition(" of ")[0]
    speed = kind == "dq"
    least = LEAST_SPEED if speed else 0.0
    excused = np.zeros(x.size, bool)
    if q is not None and np.isfinite(q).all():
        excused = _one_count(q) if speed else _turning(q)
    usual_range = float(np.ptp(np.quantile(x, [0.005, 0.995])))
    alone = (sides < 0.2 * height) & (height > tolerated)
    for k in np.flatnonzero((height > SPIKE * usual) & alone):
        if (excused[k + 2] and height[k] < usual_range) or height[k] < least * usual_range:
            continue
        around = np.r_[second[max(0, k - NEIGHBOURS) : k], second[k + 3 : k + 3 + NEIGHBOURS]]
        if height[k] > SPIKE * np.std(around):
            spikes.append(int(k))
    if not spikes:
        return []
    first = int(place[spikes[0] + 2])
    largest = float(height[spikes].max())
    text = (
        f"{name} has {len(spikes)} isolated outlier(s), of up to {largest:.4g} (unit of the log); "
        f"the first is sample {first}."
    )
    step = "Check the logger."
    if kind == "q":
        step += " A median filter (bandpass = {median = 3} under [identify]) removes them from ls."
    elif kind == "tau":
        step += " The method irls gives them hardly any weight."
    evidence = {
        "height": Quantity(largest, "unit of the file", bound=SPIKE * usual),
        **at_sample(first, log.time_of(first)),
    }
    spike = SPIKE_OF_TORQUE if kind == "tau" else SPIKE_OF_MOTION
    return [spike.finding("warning", text, name, step, evidence)]


def _turning(q: np.ndarray) -> np.ndarray:
    """Samples beside which a joint turns round or stands, shape (samples,)."""
    step = np.diff(q)
    still = np.abs(step) <= SLOW * np.quantile(np.abs(step), 0.995)
    still[1:] |= step[1:] * step[:-1] <= 0
    beside = np.r_[False, still, False]
    return np.convolve(beside, np.ones(5), "same")[:-1] > 0


def _one_count(q: np.ndarray) -> np.ndarray:
    """Samples at which a position has moved by its smallest step, shape (samples,)."""
    step = np.abs(np.diff(q, prepend=q[:1]))
    moved = step[step > 0]
    return (step > 0) & (step < ONE_STEP * moved.min()) if moved.size else np.zeros(q.size, bool)


def _clipped(
    log: Log, name: str, tau: np.ndarray, q: np.ndarray, place: np.ndarray
) -> list[Finding]:
    if not np.isfinite(q).all():
        return []
    clipped = np.flatnonzero(clipped_samples(tau, q))
    if not clipped.size:
        return []
    share = clipped.size / len(tau)
    first, value = int(place[clipped[0]]), float(tau[clipped[0]])
    severity: Severity = "error" if share > TOLERATED_CLIPPING else "warning"
    text = (
        f"{name} is cut off at {value:.6g} (unit of the log) for {clipped.size} samples "
        f"({100 * share:.2g} %), first at sample {first}."
    )
    step = "Cut these parts, or repeat the motion more slowly."
    evidence = {
        "share": Quantity(100 * share, "%", bound=100 * TOLERATED_CLIPPING),
        **at_sample(first, log.time_of(first)),
    }
    return [CLIPPED.finding(severity, text, name, step, evidence, repairs=[ACCEPT_CUT_OFF])]


def _one_value(name: str, tau: np.ndarray, q: np.ndarray) -> list[Finding]:
    """A torque that says the same while its joint moves: a dead band, or no sensor at all."""
    moving = np.abs(np.gradient(q)) > 0.05 * np.abs(np.gradient(q)).max()
    if moving.sum() < 50:
        return []
    values, counts = np.unique(tau[moving], return_counts=True)
    share = float(counts.max() / moving.sum())
    if share < ONE_VALUE:
        return []
    text = (
        f"{name} is exactly {values[counts.argmax()]:.4g} (unit of the log) during "
        f"{100 * share:.3g} % of the motion of its joint."
    )
    step = "The channel does not measure this joint; leave the joint out, or log it in another way."
    evidence = {"share": Quantity(100 * share, "%", bound=100 * ONE_VALUE)}
    return [STUCK.finding("error", text, name, step, evidence)]


def _wrapped(log: Log, name: str, q: np.ndarray, place: np.ndarray) -> list[Finding]:
    """Positions that jump by a full turn."""
    jump = np.diff(q)
    usual, whole = np.quantile(np.abs(jump), 0.999), np.ptp(q)
    for turn, unit in ((2 * math.pi, "2π"), (360.0, "360")):
        at = np.flatnonzero(np.abs(np.abs(jump) - turn) < 0.1 * turn)
        # what is wrapped stays within its turn: 6.3 in a log of degrees is a step
        if at.size and usual < 0.1 * turn and at.size < 0.001 * len(q) and whole < 1.5 * turn:
            k = int(place[at[0]])
            text = (
                f"{name} jumps by a full turn ({unit}) {at.size} time(s), first after sample {k}."
            )
            step = "Unwrap the angle before it is logged or read."
            evidence = {"jumps": Quantity(float(at.size)), **at_sample(k, log.time_of(k))}
            return [WRAPPED.finding("error", text, name, step, evidence)]
    return []
