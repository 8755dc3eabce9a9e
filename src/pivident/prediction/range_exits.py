"""Where a motion leaves the range that an estimate was fitted to.

Torques there are extrapolated: friction above all, which no record determines at speeds that it
does not have.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pivident.estimation.equation_record import MotionRange
from pivident.estimation.kinematics import Kinematics
from pivident.robot.description import Robot
from pivident.text.finding import Finding, Quantity
from pivident.text.numbers import format_significant, percent

#: A motion leaves a range where it is beyond it by this share of its extent …
BEYOND = 0.05

#: … in this share of the samples.
REPORTED = 0.01

#: The error inside and outside is compared where both have this share of the samples.
COMPARED = 0.05


@dataclass(frozen=True, eq=False)
class RangeExit:
    """How one joint leaves its fitted range."""

    joint: str  # its name
    outside: np.ndarray  # True for samples outside in position, speed or acceleration, (samples,)
    position: float  # farthest distance beyond the fitted positions [rad or m], zero within
    speed: float  # fastest speed over the fastest fitted
    acceleration: float  # likewise

    @property
    def share(self) -> float:
        """Share of the samples outside, 0 to 1."""
        return float(self.outside.mean())


def range_exits(
    robot: Robot, fitted: MotionRange, kinematics: Kinematics, span: slice
) -> tuple[RangeExit, ...]:
    """One for each joint that leaves its range, over some samples of a motion."""
    exits = []
    for j, joint in enumerate(robot.joints):
        q, dq, ddq = (x[j] for x in kinematics.stretch(span))
        low, high = fitted.low[j], fitted.high[j]
        beyond = np.maximum(np.maximum(low - q, q - high), 0.0)
        extent = max(high - low, 1e-12)
        speed, acceleration = (
            np.abs(x) / max(largest, 1e-12)
            for x, largest in ((dq, fitted.speed[j]), (ddq, fitted.acceleration[j]))
        )
        ratios = beyond / extent, speed - 1.0, acceleration - 1.0
        left = [x > BEYOND for x in ratios]
        often = [own.mean() >= REPORTED for own in left]
        if not any(often):
            continue
        farthest, fastest, hardest = (
            float(x.max()) if named else 0.0
            for x, named in zip((beyond, speed, acceleration), often, strict=True)
        )
        outside = np.any(left, axis=0)
        exits.append(RangeExit(joint.name, outside, farthest, fastest, hardest))
    return tuple(exits)


def exit_findings(
    robot: Robot, fitted: MotionRange, exits: tuple[RangeExit, ...], error: np.ndarray | None
) -> list[Finding]:
    """What each means; ``error``: τ - Φθ on the same samples, shape (samples, joints), or None."""
    findings = []
    for one in exits:
        j = robot.joint_names.index(one.joint)
        unit, torque = ("rad", "N m") if robot.joints[j].kind == "revolute" else ("m", "N")
        how = []
        if one.position:
            range_text = " to ".join(map(format_significant, (fitted.low[j], fitted.high[j])))
            far = format_significant(one.position, 2)
            how.append(f"positions beyond {range_text} {unit} by up to {far} {unit}")
        for name, ratio in (("speeds", one.speed), ("accelerations", one.acceleration)):
            if ratio:
                how.append(f"{name} up to {ratio:.1f} times the largest fitted")
        text = (
            f"{one.joint} leaves the fitted range in {percent(100 * one.share)} of the samples: "
            f"{', '.join(how)}."
        )
        if error is not None and COMPARED <= one.share <= 1.0 - COMPARED:
            outside, inside = (
                float(np.sqrt(np.mean(error[own, j] ** 2))) for own in (one.outside, ~one.outside)
            )
            text += (
                f" Its rms error there is {format_significant(outside)} {torque}, inside "
                f"{format_significant(inside)} {torque}."
            )
        evidence = {"samples outside": Quantity(100 * one.share, "%")}
        findings.append(Finding("warning", "range", "left", text, evidence=evidence))
    return findings
