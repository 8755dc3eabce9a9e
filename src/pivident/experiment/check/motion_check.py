"""What positions, torques and references say about one another before any model is fitted."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from pivident.data.logs.log import Log
from pivident.data.logs.timestamps import LOWEST_RATE
from pivident.experiment.check.remark import usable_rows
from pivident.foundation.text.finding import Finding, FindingKind, Quantity, Topic
from pivident.foundation.text.repair import setting
from pivident.judgement.audit.standstill import STILL, still_joints
from pivident.judgement.audit.timing import Timing
from pivident.robot.description import Robot
from pivident.signals.random_walk import half_power_frequencies

#: What these checks look at.
MOTION, COLUMNS, CLOCK, LIMITS = map(Topic, ("motion", "columns", "timing", "limits"))

TOO_SHORT = FindingKind(MOTION, "too short")
LOW_RATE = FindingKind(MOTION, "rate", ("recording", "rate"))
POSITION_IS_SPEED = FindingKind(COLUMNS, "position is speed", ("recording", "columns", "q"))
CONTROL_RATE = FindingKind(CLOCK, "control rate", ("recording", "control_rate"))
HELD_POSITION = FindingKind(CLOCK, "held position", ("recording", "columns", "q"))
POSITION_LIMIT = FindingKind(LIMITS, "position", ("recording", "position_offset"))
TORQUE_LIMIT = FindingKind(LIMITS, "torque", ("recording", "units", "tau"))

#: The rate of the control loop is that of the log.
AT_RATE_OF_LOG = setting("control_rate")

#: Shortest record that has room for a few motions [s], and fewest samples for each parameter.
SHORTEST, SAMPLES_EACH = 2.0, 10

#: Correlation above which one signal is another one.
SAME = 0.995

#: Samples that a band of motion needs in each of its periods.
SAMPLES_PER_PERIOD = 20

#: Share of changes that must fall on every n-th sample for a signal to be held.
REGULAR = 0.98

#: How far beyond limits a joint may be, in spans, and its torque, in limits.
BEYOND, ABOVE = 0.02, 1.2


def check_motion(log: Log, timing: Timing, parameters: int) -> list[Finding]:
    """Length, rate, held samples, limits, and channels that are something else."""
    q, tau = log.channels.get("q"), log.channels.get("tau")
    if q is None or not timing.rate or len(q) < 50:
        return []
    if tau is not None and tau.shape != q.shape:
        return []
    rows = usable_rows(q) if tau is None else usable_rows(q, tau)
    if len(rows) < 50:
        return []
    q = q[rows]
    findings = [*_length(log, timing.rate, parameters)]
    if tau is not None:
        tau = tau[rows]
        findings += [*_something_else(log, q, tau)]
    if timing.regular and not still_joints(q):
        findings += [*_slow_rate(q, timing.rate)]
    if tau is not None:
        findings += [*_held_torque(log, tau, timing.rate)]
    findings += [*_held_positions(log, q, timing.rate)]
    if log.robot is not None and log.robot.size == q.shape[1]:
        findings += [*_position_limits(log.robot, q)]
        if tau is not None:
            findings += [*_torque_limits(log.robot, tau, log.commands)]
    return findings


def _length(log: Log, rate: float, parameters: int) -> Iterator[Finding]:
    """A record that is too short for what is asked of it."""
    seconds = log.samples / rate
    needed = SAMPLES_EACH * parameters
    if log.samples < needed:
        text = f"The record is too short: {log.samples} samples for {parameters} parameters."
        step = f"{needed} samples of motion are needed; log for longer, or check part."
        yield TOO_SHORT.finding("error", text, "", step)
    elif seconds < SHORTEST:
        text = f"The record is short: {seconds:.3g} s of motion."
        step = (
            "Ten seconds or more, with moves of all joints, are far better: log for longer, "
            "or check part and the rate."
        )
        yield TOO_SHORT.finding("warning", text, "", step)


def _something_else(log: Log, q: np.ndarray, tau: np.ndarray) -> Iterator[Finding]:
    """A torque that is a position or a speed, and a position that is a speed."""
    speed = np.gradient(q, axis=0)
    others = {
        name: (_correlations(np.gradient(column), q), np.abs(_correlations(column, q)))
        for name, column in log.columns.items()
        if name not in log.clocks and len(column) == len(q) and np.isfinite(column).all()
    }
    for j, joint in enumerate(log.joint_names[: q.shape[1]]):
        for channel, signal in (("position", q[:, j]), ("speed", speed[:, j])):
            if _correlations(tau[:, j], signal[:, None])[0] > SAME:
                kind = FindingKind(COLUMNS, f"torque is {channel}", ("recording", "columns", "tau"))
                yield kind.finding(
                    "error",
                    f"The torque of {joint} is its {channel} times a factor.",
                    joint,
                    "Another column was named for tau; name that of the torque.",
                )
        for name, (slope_like, alike) in others.items():
            if slope_like[j] > SAME and alike[j] < 0.9:
                text = (
                    f"The position of {joint} is the derivative of the column {name!r}, so it is "
                    "a speed."
                )
                step = f"Positions and speeds seem swapped; name {name!r} for q."
                yield POSITION_IS_SPEED.finding("error", text, joint, step)
                break


def _correlations(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Correlation of a signal with each column of others, zero where one of the two is constant."""
    x = x - x.mean()
    size = np.linalg.norm(x) * np.sqrt(len(y)) * y.std(axis=0)
    return np.divide(x @ y, size, out=np.zeros(y.shape[1]), where=size > 0)


def _slow_rate(q: np.ndarray, rate: float) -> Iterator[Finding]:
    """A motion that is too fast for the rate at which it was logged.

    Above twice the half-power frequency of a joint's smoother is noise, such as that of rounding.
    """
    q = q[:, np.ptp(q, axis=0) > STILL]
    speed = np.diff(q, axis=0)
    if not speed.size:
        return
    speed = speed - speed.mean(axis=0)
    power = np.abs(np.fft.rfft(speed * np.hanning(len(speed))[:, None], axis=0)) ** 2
    frequencies = np.arange(len(power)) * rate / len(speed)
    power[frequencies[:, None] > 2.0 * half_power_frequencies(q, rate)] = 0.0
    total = power.sum(axis=0)
    share = np.median(np.cumsum(power, axis=0) / np.where(total > 0, total, 1.0), axis=1)
    band = float(np.searchsorted(share, 0.99)) * rate / len(speed)
    if band * SAMPLES_PER_PERIOD > rate:
        text = (
            f"The rate of {rate:.4g} Hz is low for this motion: 99 % of its speed lies below "
            f"{band:.3g} Hz."
        )
        step = (
            f"Accelerations come out too small; log at {SAMPLES_PER_PERIOD * band:.0f} Hz or "
            "more, or move more smoothly."
        )
        yield LOW_RATE.finding("warning", text, "", step)


def _held_torque(log: Log, tau: np.ndarray, rate: float) -> Iterator[Finding]:
    """Torques that change only at every n-th sample, against the declared control rate."""
    holds = [_hold(tau[:, j]) for j in range(tau.shape[1])]
    n = min(holds)
    declared = log.control_rate or rate
    if declared < LOWEST_RATE:
        text = f"control_rate is {declared:.5g} Hz, which no control loop has."
        step = "It may be a period in seconds, or a rate in kHz; it is given in Hz."
        yield CONTROL_RATE.finding("error", text, "", step)
    elif n > 1 and abs(declared * n / rate - 1) > 0.05:
        text = (
            f"The torque changes only once every {n} samples: the control loop seems to run at "
            f"{rate / n:.5g} Hz, not at {declared:.5g} Hz."
        )
        loop_rate = float(f"{rate / n:.5g}")
        step = f"Set control_rate = {loop_rate:.5g} under [recording] if that is so."
        words = f"Declare the rate of the control loop: control_rate = {loop_rate:.5g}."
        repairs = [setting("control_rate", value=loop_rate, words=words)]
        yield CONTROL_RATE.finding("warning", text, "tau", step, repairs=repairs)
    elif n == 1 and declared < 0.95 * rate:
        text = (
            f"control_rate is {declared:.5g} Hz, but the torque changes at every sample of "
            f"{rate:.5g} Hz."
        )
        step = (
            "Correct control_rate (in Hz), or leave it out where the log runs at the loop's rate."
        )
        yield CONTROL_RATE.finding("warning", text, "tau", step, repairs=[AT_RATE_OF_LOG])
    elif declared > 50 * rate:
        text = (
            f"control_rate is {declared:.5g} Hz, {declared / rate:.3g} times the rate of the log."
        )
        step = "It is in Hz; correct it."
        yield CONTROL_RATE.finding("warning", text, "", step)


def _held_positions(log: Log, q: np.ndarray, rate: float) -> Iterator[Finding]:
    """Positions that change only at every n-th sample."""
    slow = [j for j in range(q.shape[1]) if _hold(q[:, j]) > 1]
    if slow:
        n = _hold(q[:, slow[0]])
        yield HELD_POSITION.finding(
            "warning",
            f"The position of {log.joint_names[slow[0]]} changes only once every {n} samples: it "
            f"was measured at {rate / n:.5g} Hz and repeated.",
            log.joint_names[slow[0]],
            "Log at the rate of the measurement; repeated positions give wrong accelerations.",
        )


def _hold(x: np.ndarray) -> int:
    """Samples for which a signal is held while it changes at all, 1 where it is not held."""
    changes = np.flatnonzero(np.diff(x) != 0) + 1
    if len(changes) < 50:
        return 1
    gaps = np.diff(changes)
    n = int(np.median(gaps))
    if n < 2:
        return 1
    phase = np.bincount(changes % n, minlength=n)
    return n if phase.max() > REGULAR * len(changes) else 1


def _position_limits(robot: Robot, q: np.ndarray) -> Iterator[Finding]:
    """Positions a little beyond the limits."""
    for j, joint in enumerate(robot.joints):
        turning = joint.kind == "revolute"
        scale, unit = (180 / np.pi, "°") if turning else (1e3, "mm")
        if joint.position_limits is not None and np.isfinite(joint.position_limits).all():
            low, high = joint.position_limits
            span = high - low
            over = max(float(q[:, j].max()) - high, low - float(q[:, j].min()))
            if BEYOND * span < over:
                lowest, highest = (scale * float(x) for x in (q[:, j].min(), q[:, j].max()))
                mirrored = max(-float(q[:, j].min()) - high, low + float(q[:, j].max()))
                step = "Another unit or gear ratio, or a zero that lies elsewhere: position_offset."
                if mirrored <= BEYOND * span:
                    step = (
                        "It seems to count the other way: with the other sign it lies within the "
                        "limits. Give q and the reference of the joint the other sign (-1 in a "
                        "list under units), and tau as well if it counts as they do; or set "
                        "position_offset if its zero lies elsewhere."
                    )
                yield POSITION_LIMIT.finding(
                    "warning",
                    f"{joint.name} is logged from {lowest:.4g} {unit} to {highest:.4g} {unit}; its "
                    f"limits are {scale * low:.4g} {unit} to {scale * high:.4g} {unit}.",
                    joint.name,
                    step,
                    {"lowest": Quantity(lowest, unit), "highest": Quantity(highest, unit)},
                )


def _torque_limits(robot: Robot, tau: np.ndarray, commands: tuple[int, ...]) -> Iterator[Finding]:
    """Torques that the drives do not have."""
    for j, joint in enumerate(robot.joints):
        limit = joint.torque_limit
        largest = float(np.abs(tau[:, j]).max())
        if limit and j not in commands and largest > ABOVE * limit:
            unit = "N m" if joint.kind == "revolute" else "N"
            yield TORQUE_LIMIT.finding(
                "warning",
                f"The torque of {joint.name} reaches {largest:.4g} {unit}; its limit is "
                f"{limit:.4g} {unit}.",
                joint.name,
                "Check unit, side and drive gain of tau, or the limit of the description.",
                {"torque": Quantity(largest, unit), "limit": Quantity(limit, unit)},
            )
