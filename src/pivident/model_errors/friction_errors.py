"""Friction that is off: other shapes over the speed, the position, the load and the time.

The columns stand beside those of the law that the joint has. They are amplitudes of shapes, not a
law: `pivident laws` finds one. Friction that changes with the time of a record is that of a drive
that warms up.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from pivident.model_errors.cause import Cause, on_joint
from pivident.model_errors.record_motion import Reach, RecordMotion
from pivident.robot.description import Robot
from pivident.robot.friction import FrictionColumn

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
