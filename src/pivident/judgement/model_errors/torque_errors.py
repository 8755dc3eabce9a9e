"""Torques and friction that are off: instant, scale, ripple, gear ratio, springs, friction.

A torque that was logged T later than it acted is τ(t - T), which adds -T dτ/dt; one that acts later
than it was logged has the other sign. A gain that is off by κ adds κ τ_j. With a gear ratio that is
off, positions and torques of the joint are off in opposite directions, q/(1 + κ) and τ(1 + κ).

A spring that holds a joint to the link before it, as one that carries weight, adds k (q - q_0).

Friction may have other shapes over the speed, the position, the load and the time. Their columns
stand beside those of the law that the joint has; they are amplitudes of shapes, not a law:
`pivident laws` finds one. Friction that changes with the time of a record is that of a drive that
warms up.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from pivident.data.recording.recording import Recording
from pivident.dynamics.friction import expression_value
from pivident.estimation.problem import Problem
from pivident.judgement.model_errors.cause import (
    NEGLIGIBLE,
    STEP,
    Cause,
    Reach,
    RecordMotion,
    on_joint,
)
from pivident.judgement.model_errors.motion_errors import PERCENT, with_positions, with_torques
from pivident.robot.description import Robot
from pivident.robot.friction_column import names_in
from pivident.robot.friction_terms import TERM_KINDS
from pivident.robot.joints import Joint
from pivident.signals.cubic_spline import cubic_spline

#: Milliseconds, the unit of delays [s].
MILLISECOND = 1e-3

#: Largest sizes that are believed.
LARGEST = {"%": 30.0}


def torque_causes(robot: Robot, band: float, pace: np.ndarray) -> Iterator[Cause]:
    """Delay and gain of all torques and of each, ripple of each, ratio of each gear, the clock.

    Args:
        robot: the robot.
        band: highest frequency of the motion [Hz]; a radian of it is believed of any delay: 8 ms of
            20 Hz.
        pace: the ω of the joints' motion [rad/s], shape (joints,), of which half a radian is
            believed as well: up to there a delay of a sine is its slope to 4 %.
    """
    longest = np.maximum(1.0 / (2.0 * np.pi * band), 0.5 / np.maximum(pace, 1e-3)) / MILLISECOND
    yield _delay(robot, None, float(np.median(longest)))
    yield _gain_of_all()
    yield _clock()
    for j, joint in enumerate(robot.joints):
        if joint.motion != "driven":
            continue
        if robot.size > 1:
            yield _delay(robot, j, float(longest[j]))
        yield _gain(joint.name, j)
        if robot.torque_side == "motor":
            yield _ratio(joint.name, j, "ratio" if joint.kind == "revolute" else "pitch")
            motor = abs(float(robot.transmission.reduction[j, j]))
            if joint.kind == "revolute" and motor > 1.0:
                yield _ripple(joint.name, j, motor, joint.torque_unit)


def _delay(robot: Robot, joint: int | None, longest: float) -> Cause:
    """-dτ/dt of one joint, or of all."""

    def columns(motion: RecordMotion) -> np.ndarray:
        slope = -MILLISECOND * motion.derivative(motion.torque)
        return slope[None] if joint is None else on_joint(joint, [slope[joint]], motion)

    def correct(problem: Problem, size: np.ndarray) -> Problem:
        return with_delay(problem, joint, MILLISECOND * float(size[0]))

    name = "" if joint is None else robot.joint_names[joint]
    what = "torques logged later than positions"
    return Cause("delay", name, what, "ms", columns, 1, correct, longest)


def _gain(name: str, j: int) -> Cause:
    def columns(motion: RecordMotion) -> np.ndarray:
        return on_joint(j, [PERCENT * motion.torque[j]], motion)

    def correct(problem: Problem, size: np.ndarray) -> Problem:
        return with_gain(problem, j, float(size[0]))

    what = "excess of the logged torques"
    return Cause("torque gain", name, what, "%", columns, 1, correct, LARGEST["%"])


def _gain_of_all() -> Cause:
    """A gain of all torques, which no record shows: all parameters have it."""

    def columns(motion: RecordMotion) -> np.ndarray:
        return PERCENT * motion.torque[None]

    return Cause("torque gain", "", "excess of all logged torques", "%", columns)


def _clock() -> Cause:
    """A clock that runs fast: speeds are less than it says, accelerations by twice as much.

    No size is believed: much else that is wrong with the whole resembles it. Logged speeds show it.
    """

    def columns(motion: RecordMotion) -> np.ndarray:
        still = np.zeros(motion.q.shape[1])
        changes = zip(motion.dq, 2.0 * motion.ddq, strict=True)
        moved = [motion.along(j, (still, *own), STEP) for j, own in enumerate(changes)]
        return -PERCENT * np.sum(moved, axis=0)[None]

    return Cause("clock", "", "excess of the assumed rate", "%", columns, largest=0.0)


def _ratio(name: str, j: int, word: str) -> Cause:
    def columns(motion: RecordMotion) -> np.ndarray:
        change = motion.q[j], motion.dq[j], motion.ddq[j]
        moved = motion.along(j, change, STEP)[None]
        return PERCENT * (moved + on_joint(j, [motion.torque[j]], motion))

    def correct(problem: Problem, size: np.ndarray) -> Problem:
        moved = with_positions(problem, j, lambda q, _: q * (1.0 + PERCENT * size[0]))
        return with_gain(moved, j, float(size[0]))

    what = f"excess of the assumed {word}"
    return Cause("gear ratio", name, what, "%", columns, 1, correct, LARGEST["%"])


def _ripple(name: str, j: int, order: float, unit: str) -> Cause:
    def columns(motion: RecordMotion) -> np.ndarray:
        angle = order * motion.q[j]
        return on_joint(j, [np.sin(angle), np.cos(angle)], motion)

    return Cause("torque ripple", name, "ripple once per turn of the motor", unit, columns, 2)


def with_gain(problem: Problem, j: int, percent: float) -> Problem:
    """The problem with one joint's torques divided by a gain that is off by some percent."""
    return with_torques(problem, j, lambda r: r.tau[:, j] / (1.0 + PERCENT * percent))


def with_delay(problem: Problem, joint: int | None, delay: float) -> Problem:
    """The problem with a further delay of the torques [s], of one joint or of all.

    A delay of all is declared; a negative one is that of a drive, which the loop then has, too. A
    joint's own is taken out of its torques.
    """

    def declared(recording: Recording) -> Recording:
        total = recording.delay - recording.drive_delay + delay
        return replace(recording, delay=max(total, 0.0), drive_delay=max(-total, 0.0))

    def moved(recording: Recording) -> np.ndarray:
        t = np.arange(recording.samples) / recording.rate
        return cubic_spline(t, recording.tau[:, joint])(np.clip(t + delay, t[0], t[-1]))

    if joint is None:
        return replace(problem, recordings=tuple(map(declared, problem.recordings)))
    return with_torques(problem, joint, moved)


def spring_causes(robot: Robot, reach: Reach) -> Iterator[Cause]:
    """A spring beside the motor of each joint whose law has none; it rests at any position."""
    for j, joint in enumerate(robot.joints):
        if joint.motion == "driven" and "spring" not in _columns_of(joint):
            yield _spring(joint, j, 0.5 * float(reach.low[j] + reach.high[j]))


def _spring(joint: Joint, j: int, middle: float) -> Cause:
    """Torque k (q - q_0) on one joint; k q_0 is in its offset."""
    count = 1 if "offset" in _columns_of(joint) else 2

    def columns(motion: RecordMotion) -> np.ndarray:
        signals = [motion.q[j] - middle, np.ones(motion.q.shape[1])]
        return on_joint(j, signals[:count], motion)

    unit = f"{joint.torque_unit}/{'rad' if joint.kind == 'revolute' else 'm'}"
    return Cause(
        "spring",
        joint.name,
        "stiffness of a spring",
        unit,
        columns,
        count,
        by_first=True,
        is_smooth=True,
        least_torque=NEGLIGIBLE,
        by_effect=True,
        phrase=f"a spring of {{size}} at {joint.name}",
    )


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
        strongest = float(reach.strongest[j])  # a larger amplitude is none that friction has
        for what, shapes in _shapes(reach, j, slope, _columns_of(joint)).items():
            yield _cause("friction", joint.name, what, unit, j, slope, shapes, strongest)
        yield _cause(
            "uneven friction", joint.name, "along the travel", unit, j, slope,
            _uneven(float(reach.low[j]), float(reach.high[j])), strongest,
        )  # fmt: skip
        warming, unit = _warming(float(reach.fastest[j])), f"{unit}/min"
        yield _cause("warming up", joint.name, "friction by time", unit, j, slope, warming, np.inf)


def _columns_of(joint: Joint) -> set[str]:
    """Names of the columns of a joint's law."""
    return {term.column.name for term in joint.friction.terms}


def _shapes(reach: Reach, joint: int, slope: float, names: set[str]) -> dict[str, list[Shape]]:
    """Shapes by name, each relative to the joint's largest speed and travel.

    ``names``: columns of the joint's law.
    """
    fastest = float(reach.fastest[joint])
    found: dict[str, list[Shape]] = {}
    for kind in TERM_KINDS.usable().values():
        # a term without constants leaves nothing of its shape
        if len(kind.columns) > 1 or kind.constants or kind.columns[0].name not in names:
            found |= {what: [_declared(text, fastest)] for what, text in kind.causes.items()}
    for factor in STEEPNESS:
        found[f"a sign {factor:g} times as steep"] = [_steeper(factor * slope)]
    found["another smoothed sign"] = [lambda m, j, s: np.tanh(slope * m.dq[j]) - s]
    return found


def _declared(expression: str, fastest: float) -> Shape:
    """The shape that a friction term declares; see ``TermKind.causes``."""

    def shape(m: RecordMotion, j: int, s: np.ndarray) -> np.ndarray:
        quantities = {"dq": m.dq[j], "s": s, "fastest": fastest}
        if "load" in names_in(expression):
            heaviest = max(float(np.abs(m.load[j]).max()), 1e-300)
            quantities |= {"load": m.load[j], "heaviest": heaviest}
        return np.zeros_like(s) + expression_value(expression, quantities)

    return shape


def _steeper(slope: float) -> Shape:
    """What a sign of another slope [s/rad or s/m] has beside that of the law."""
    return lambda m, j, s: _sign(slope, m.dq[j]) - s


def _uneven(low: float, high: float) -> list[Shape]:
    """Dry friction that changes over the travel, along a line and a parabola."""
    middle, half = 0.5 * (low + high), max(0.5 * (high - low), 1e-300)
    return [
        lambda m, j, s: s * (m.q[j] - middle) / half,
        lambda m, j, s: s * ((m.q[j] - middle) / half) ** 2,
    ]


def _warming(fastest: float) -> list[Shape]:
    """Dry and viscous friction that change with time."""
    return [
        lambda m, j, s: s * m.seconds / MINUTE,
        lambda m, j, s: m.dq[j] / fastest * m.seconds / MINUTE,
    ]


def _cause(
    kind: str, name: str, what: str, unit: str, joint: int, slope: float, shapes: list[Shape],
    largest: float,
) -> Cause:  # fmt: skip
    def columns(motion: RecordMotion) -> np.ndarray:
        sign = _sign(slope, motion.dq[joint])
        return on_joint(joint, [shape(motion, joint, sign) for shape in shapes], motion)

    return Cause(kind, name, what, unit, columns, len(shapes), largest=largest)


def _sign(slope: float, speed: np.ndarray) -> np.ndarray:
    """(2/π) atan(γ dq)."""
    return np.asarray(2.0 / np.pi * np.arctan(slope * speed))
