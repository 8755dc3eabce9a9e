"""Positions that are off: zero, scale, encoder, spring and play between motor and link.

An error δq(t) of one joint's position changes speeds and accelerations with it, and the torque by
its derivative along all three. Behind a spring of stiffness k the link is at q - τ_load/k, with
play of width b at q - (b/2) sign(τ_load), and only what the link carries moves with it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from pivident.estimation.problem import Problem
from pivident.model_errors.cause import Cause
from pivident.model_errors.geometry import DEGREE
from pivident.model_errors.record_motion import SAMPLES_PER_PERIOD, STEP, RecordMotion
from pivident.recording.recording import Recording
from pivident.robot.description import Robot
from pivident.signals.bandpass import butterworth

#: Percent, milliradian, and what a radian per newton metre is in the unit of compliances.
PERCENT, MILLI, MICRO = 1e-2, 1e-3, 1e-6

#: Largest sizes that are believed.
LARGEST = {"°": 5.0, "mm": 50.0, "%": 20.0, "mrad": 20.0}

#: Share of the largest load at which play has been taken up.
TAKEN_UP = 0.02

#: Highest frequency of the errors of a spring and of play, in bands of the motion.
WITHIN = 2.0

#: Periods of a joint's turn that its encoder may have errors of.
TURNS = (1, 2)


def motion_causes(robot: Robot) -> Iterator[Cause]:
    """Zero position, scale and errors of each encoder, spring and play behind each motor."""
    for j, joint in enumerate(robot.joints):
        if joint.motion != "driven":
            continue
        turns = joint.kind == "revolute"
        zero, unit = (DEGREE, "°") if turns else (MILLI, "mm")
        yield _shifted(joint.name, j, zero, unit)
        yield _scaled(joint.name, j)
        if turns:
            orders = [(float(n), "turn of the joint") for n in TURNS]
            motor = abs(float(robot.transmission.reduction[j, j]))
            if motor > TURNS[-1]:
                orders.append((motor, "turn of the motor"))
            for order, words in orders:
                yield _sine(joint.name, j, order, words)
        if robot.torque_side == "motor":
            yield _spring(joint.name, j, turns)
            yield _play(joint.name, j, turns)


def _shifted(name: str, j: int, scale: float, unit: str) -> Cause:
    def columns(motion: RecordMotion) -> np.ndarray:
        one, none = np.ones(motion.q.shape[1]), np.zeros(motion.q.shape[1])
        return scale * motion.along(j, (one, none, none), STEP)[None]

    def correct(problem: Problem, size: np.ndarray) -> Problem:
        return with_positions(problem, j, lambda q: q + scale * size[0])

    what = "correction of the zero position"
    return Cause("zero position", name, what, unit, columns, 1, correct, LARGEST[unit])


def _scaled(name: str, j: int) -> Cause:
    def columns(motion: RecordMotion) -> np.ndarray:
        change = motion.q[j], motion.dq[j], motion.ddq[j]
        return PERCENT * motion.along(j, change, STEP)[None]

    def correct(problem: Problem, size: np.ndarray) -> Problem:
        return with_positions(problem, j, lambda q: q * (1.0 + PERCENT * size[0]))

    return Cause(
        "position scale",
        name,
        "correction of the scale of the positions",
        "%",
        columns,
        correct=correct,
    )


def _sine(name: str, j: int, order: float, words: str) -> Cause:
    """δq = a sin(nq) + b cos(nq), with its derivatives by time."""

    def columns(motion: RecordMotion) -> np.ndarray:
        q, dq, ddq = motion.q[j], motion.dq[j], motion.ddq[j]
        found = []
        for phase in (0.0, 0.5 * np.pi):
            sine, cosine = np.sin(order * q + phase), np.cos(order * q + phase)
            change = (
                sine,
                order * cosine * dq,
                order * cosine * ddq - order**2 * sine * dq**2,
            )
            found.append(MILLI * motion.along(j, change, STEP / order**2))
        return np.array(found)

    def correct(problem: Problem, size: np.ndarray) -> Problem:
        a, b = MILLI * size
        return with_positions(
            problem, j, lambda q: q + a * np.sin(order * q) + b * np.cos(order * q), ref=False
        )

    what = f"correction of the encoder once per {words}"
    if order == TURNS[1]:
        what = f"correction of the encoder twice per {words}"
    return Cause("encoder", name, what, "mrad", columns, 2, correct, LARGEST["mrad"])


def _behind_motor(
    name: str, j: int, kind: str, what: str, unit: str, error: Callable[[np.ndarray], np.ndarray],
    scale: float,
) -> Cause:  # fmt: skip
    """An error of the link's position that follows from the torque it carries."""

    def columns(motion: RecordMotion) -> np.ndarray:
        cutoff = WITHIN * motion.rate / SAMPLES_PER_PERIOD
        delta = -butterworth(error(motion.load[j]), motion.rate, cutoff)
        speed = motion.derivative(delta)
        change = delta, speed, motion.derivative(speed)
        largest = max(float(np.abs(delta).max()), 1e-300)
        return scale * motion.along(j, change, STEP / largest, load=True)[None]

    largest = LARGEST.get(unit, np.inf)
    return Cause(kind, name, what, unit, columns, largest=largest, is_positive=True, is_rough=True)


def _spring(name: str, j: int, turns: bool) -> Cause:
    unit = "µrad/(N m)" if turns else "µm/N"
    what = "compliance between motor and link"
    return _behind_motor(name, j, "elasticity", what, unit, lambda load: load, MICRO)


def _play(name: str, j: int, turns: bool) -> Cause:
    def error(load: np.ndarray) -> np.ndarray:
        return 0.5 * np.tanh(load / (TAKEN_UP * max(float(np.abs(load).max()), 1e-300)))

    unit = "mrad" if turns else "mm"
    return _behind_motor(name, j, "backlash", "play behind the motor", unit, error, MILLI)


def with_positions(
    problem: Problem, j: int, change: Callable[[np.ndarray], np.ndarray], ref: bool = True
) -> Problem:
    """The problem with one joint's positions corrected, and its reference with them."""

    def corrected(recording: Recording) -> Recording:
        q = recording.q.copy()
        q[:, j] = change(q[:, j])
        reference = recording.q_ref
        if ref and reference is not None:
            reference = reference.copy()
            reference[:, j] = change(reference[:, j])
        return replace(recording, q=q, q_ref=reference)

    return replace(problem, recordings=tuple(corrected(r) for r in problem.recordings))
