"""Torques and friction that are off: instant, scale, ripple and gear ratio, shapes of friction.

A torque that was logged T later than it acted is τ(t - T), which adds -T dτ/dt; one that acts later
than it was logged has the other sign. A gain that is off by κ adds κ τ_j. With a gear ratio that is
off, positions and torques of the joint are off in opposite directions, q/(1 + κ) and τ(1 + κ).

Friction may have other shapes over the speed, the position, the load and the time. Their columns
stand beside those of the law that the joint has; they are amplitudes of shapes, not a law:
`pivident laws` finds one. Friction that changes with the time of a record is that of a drive that
warms up.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from pivident.estimation.problem import Problem
from pivident.model_errors.cause import Cause, on_joint
from pivident.model_errors.motion_errors import PERCENT, with_positions
from pivident.model_errors.record_motion import STEP, Reach, RecordMotion
from pivident.recording.recording import Recording
from pivident.robot.description import Robot
from pivident.robot.friction import FrictionColumn

#: Milliseconds, the unit of delays [s].
MILLISECOND = 1e-3

#: Largest sizes that are believed: a delay shorter than a radian of the motion's highest frequency.
LARGEST = {"ms": 8.0, "%": 30.0}


def torque_causes(robot: Robot) -> Iterator[Cause]:
    """Delay of all torques and of each, gain and ripple of each, ratio of each gear."""
    yield _delay(robot, None)
    for j, joint in enumerate(robot.joints):
        if joint.motion != "driven":
            continue
        if robot.size > 1:
            yield _delay(robot, j)
        yield _gain(joint.name, j)
        if robot.torque_side == "motor":
            yield _ratio(joint.name, j)
            motor = abs(float(robot.transmission.reduction[j, j]))
            if joint.kind == "revolute" and motor > 1.0:
                yield _ripple(joint.name, j, motor, joint.torque_unit)


def _delay(robot: Robot, joint: int | None) -> Cause:
    """-dτ/dt of one joint, or of all."""

    def columns(motion: RecordMotion) -> np.ndarray:
        slope = -MILLISECOND * motion.derivative(motion.torque)
        return slope[None] if joint is None else on_joint(joint, [slope[joint]], motion)

    def correct(problem: Problem, size: np.ndarray) -> Problem:
        return with_delay(problem, joint, MILLISECOND * float(size[0]))

    name = "" if joint is None else robot.joint_names[joint]
    what = "torques logged later than positions"
    return Cause("delay", name, what, "ms", columns, 1, correct, LARGEST["ms"])


def _gain(name: str, j: int) -> Cause:
    def columns(motion: RecordMotion) -> np.ndarray:
        return on_joint(j, [PERCENT * motion.torque[j]], motion)

    def correct(problem: Problem, size: np.ndarray) -> Problem:
        return with_gain(problem, j, float(size[0]))

    what = "excess of the logged torques"
    return Cause("torque gain", name, what, "%", columns, 1, correct, LARGEST["%"])


def _ratio(name: str, j: int) -> Cause:
    def columns(motion: RecordMotion) -> np.ndarray:
        change = motion.q[j], motion.dq[j], motion.ddq[j]
        moved = motion.along(j, change, STEP)[None]
        return PERCENT * (moved + on_joint(j, [motion.torque[j]], motion))

    def correct(problem: Problem, size: np.ndarray) -> Problem:
        moved = with_positions(problem, j, lambda q: q * (1.0 + PERCENT * size[0]))
        return with_gain(moved, j, float(size[0]))

    what = "excess of the assumed ratio"
    return Cause("gear ratio", name, what, "%", columns, 1, correct, LARGEST["%"])


def _ripple(name: str, j: int, order: float, unit: str) -> Cause:
    def columns(motion: RecordMotion) -> np.ndarray:
        angle = order * motion.q[j]
        return on_joint(j, [np.sin(angle), np.cos(angle)], motion)

    return Cause("torque ripple", name, "ripple once per turn of the motor", unit, columns, 2)


def with_gain(problem: Problem, j: int, percent: float) -> Problem:
    """The problem with one joint's torques divided by a gain that is off by some percent."""

    def corrected(recording: Recording) -> Recording:
        tau = recording.tau.copy()
        tau[:, j] /= 1.0 + PERCENT * percent
        return replace(recording, tau=tau)

    return replace(problem, recordings=tuple(corrected(r) for r in problem.recordings))


def with_delay(problem: Problem, joint: int | None, delay: float) -> Problem:
    """The problem with a further delay of the torques [s], of one joint or of all.

    A delay of all is declared; a negative one is that of a drive, which the loop then has, too. A
    joint's own is taken out of its torques.
    """
    from scipy.interpolate import CubicSpline

    def corrected(recording: Recording) -> Recording:
        if joint is None:
            total = recording.delay - recording.drive_delay + delay
            return replace(recording, delay=max(total, 0.0), drive_delay=max(-total, 0.0))
        tau = recording.tau.copy()
        t = np.arange(len(tau)) / recording.rate
        wanted = np.clip(t + delay, t[0], t[-1])
        tau[:, joint] = CubicSpline(t, tau[:, joint])(wanted)
        return replace(recording, tau=tau)

    return replace(problem, recordings=tuple(corrected(r) for r in problem.recordings))


#: Stribeck speeds that are tried, as shares of the largest speed.
STRIBECK_SPEEDS = (0.01, 0.03, 0.1)

#: Factors of the slope of the smoothed sign that are tried.
STEEPNESS = (0.3, 3.0)

#: Unit of the time over which friction changes [s].
MINUTE = 60.0

#: One shape over a joint's motion, shape (samples,) from the motion and the sign of its speed.
Shape = Callable[[RecordMotion, int, np.ndarray], np.ndarray]


def friction_causes(robot: Robot, reach: Reach) -> Iterator[Cause]:
    """Further shapes of friction of each joint."""
    for j, joint in enumerate(robot.joints):
        if not joint.friction.terms:
            continue
        unit = joint.torque_unit
        slope = max(joint.friction.slopes, default=joint.default_gamma)
        kinds = {term.column for term in joint.friction.terms}
        for what, shapes in _shapes(reach, j, slope, kinds).items():
            yield _cause("friction", joint.name, what, unit, j, slope, shapes)
        warming, unit = _warming(float(reach.fastest[j])), f"{unit}/min"
        yield _cause("warming up", joint.name, "friction by time", unit, j, slope, warming)


def _shapes(
    reach: Reach, joint: int, slope: float, kinds: set[FrictionColumn]
) -> dict[str, list[Shape]]:
    """Shapes by name, each relative to the joint's largest speed and travel."""
    fastest = float(reach.fastest[joint])
    middle = 0.5 * float(reach.low[joint] + reach.high[joint])
    half = max(0.5 * float(reach.high[joint] - reach.low[joint]), 1e-300)
    found: dict[str, list[Shape]] = {}
    for share in STRIBECK_SPEEDS:
        found[f"Stribeck peak below {share:g} of the largest speed"] = [_peak(share * fastest)]
    for factor in STEEPNESS:
        found[f"a sign {factor:g} times as steep"] = [_steeper(factor * slope)]
    found["another smoothed sign"] = [lambda m, j, s: np.tanh(slope * m.dq[j]) - s]
    found["square of the speed"] = [lambda m, j, s: m.dq[j] * np.abs(m.dq[j]) / fastest**2]
    found["root of the speed"] = [lambda m, j, s: s * np.sqrt(np.abs(m.dq[j]) / fastest)]
    found["other friction in one direction"] = [lambda m, j, s: np.abs(m.dq[j]) / fastest]
    if FrictionColumn.LOAD not in kinds:
        found["friction by load"] = [
            lambda m, j, s: s * np.abs(m.load[j]) / max(float(np.abs(m.load[j]).max()), 1e-300)
        ]
    if FrictionColumn.OFFSET not in kinds:
        found["constant torque"] = [lambda m, j, s: np.ones_like(s)]
    found["friction by position"] = [
        lambda m, j, s: s * (m.q[j] - middle) / half,
        lambda m, j, s: s * ((m.q[j] - middle) / half) ** 2,
    ]
    return found


def _peak(speed: float) -> Shape:
    """Friction that falls off beyond a speed [rad/s or m/s]."""
    return lambda m, j, s: s * np.exp(-((m.dq[j] / speed) ** 2))


def _steeper(slope: float) -> Shape:
    """What a sign of another slope [s/rad or s/m] has beside that of the law."""
    return lambda m, j, s: _sign(slope, m.dq[j]) - s


def _warming(fastest: float) -> list[Shape]:
    """Dry and viscous friction that change with time."""
    return [
        lambda m, j, s: s * m.seconds / MINUTE,
        lambda m, j, s: m.dq[j] / fastest * m.seconds / MINUTE,
    ]


def _cause(
    kind: str, name: str, what: str, unit: str, joint: int, slope: float, shapes: list[Shape]
) -> Cause:
    def columns(motion: RecordMotion) -> np.ndarray:
        sign = _sign(slope, motion.dq[joint])
        return on_joint(joint, [shape(motion, joint, sign) for shape in shapes], motion)

    return Cause(kind, name, what, unit, columns, len(shapes))


def _sign(slope: float, speed: np.ndarray) -> np.ndarray:
    """(2/π) atan(γ dq)."""
    return np.asarray(2.0 / np.pi * np.arctan(slope * speed))
