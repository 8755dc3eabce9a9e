"""Torques that are off: their instant, their scale, ripple of the motor, a ratio of the gear.

A torque that was logged T later than it acted is τ(t - T), which adds -T dτ/dt; one that acts later
than it was logged has the other sign. A gain that is off by κ adds κ τ_j. With a gear ratio that is
off, positions and torques of the joint are off in opposite directions, q/(1 + κ) and τ(1 + κ).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from pivident.estimation.problem import Problem
from pivident.model_errors.cause import Cause, on_joint
from pivident.model_errors.motion_errors import PERCENT, with_positions
from pivident.model_errors.record_motion import STEP, RecordMotion
from pivident.recording.recording import Recording
from pivident.robot.description import Robot

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
