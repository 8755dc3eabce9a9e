"""Geometry and positions that are off: lengths, angles, zero, scale, encoder, spring and play.

An error δq(t) of one joint's position changes speeds and accelerations with it, and the torque by
its derivative along all three. An encoder that turns with a share s of another joint reads
q + s q_i for its position q. What the gear transmits to the link, τ_link, is its load without the
rotor's inertia. Behind a spring of stiffness k the link is at q - τ_link/k, with play of width b at
q - (b/2) sign(τ_link), and only what the link carries moves with it. From one flank to the other,
for some ten milliseconds, it is free: d²δq/dt² = -τ_link/M with M = ∂τ_link/∂ddq.

Geometry that is off: lengths and angles between joints, and the way up.

The frame of a joint in its parent's link has six coordinates, of which a turn about its own axis is
the zero position, see `motion_errors`. Columns are the derivative of Φθ by each, from torques of
the robot changed by a small step. Parameters whose groups change with the geometry take up what
lies in the space of Φ; what remains is seen by no other parameter.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import lru_cache
from itertools import permutations
from typing import Any

import numpy as np

from pivident.data.recording.recording import Recording
from pivident.dynamics.regressor import Regressor
from pivident.dynamics.robot_regressor import regressor_of
from pivident.estimation.problem import Problem
from pivident.foundation.compiled import kernel
from pivident.judgement.model_errors.cause import (
    NEGLIGIBLE,
    SAMPLES_PER_PERIOD,
    STEP,
    Cause,
    RecordMotion,
)
from pivident.robot.description import Robot
from pivident.robot.joints import Joint
from pivident.signals.bandpass import butterworth

#: Percent, milliradian, and what a radian per newton metre is in the unit of compliances.
PERCENT, MILLI, MICRO = 1e-2, 1e-3, 1e-6
#: Largest sizes that are believed.
LARGEST = {"°": 5.0, "mm": 50.0, "%": 20.0, "mrad": 20.0}
#: Play for which the time between the flanks is reckoned [mrad, mm]; its third root counts.
PLAY = {"mrad": 0.5, "mm": 0.05}
#: Highest frequency of the errors of a spring and of play, in bands of the motion.
WITHIN = 2.0
#: Periods of a joint's turn that its encoder may have errors of.
TURNS = (1, 2)
#: Size of one unit in which geometry is told: millimetres and degrees [m, rad].
MILLIMETRE, DEGREE = 1e-3, np.pi / 180.0
#: Steps of the differences [mm, °].
STEPS = {"mm": 1e-2, "°": 1e-3}
#: Direction of gravity beyond which a turn about an axis leaves it where it is.
UPRIGHT = 0.99
#: A robot changed by a length [m] or an angle [rad].
Change = Callable[[Robot, float], Robot]
#: Share of a joint's torque below which that of a slight change is rounding, and none.
ROUNDING = 1e-12
#: Positions of a joint corrected, shape (samples,), from these and those of all joints.
Correct = Callable[[np.ndarray, np.ndarray], np.ndarray]
AXES = "xyz"


def geometry_causes(robot: Robot) -> Iterator[Cause]:
    """Lengths and angles between the joints, and the direction of gravity."""
    # lengths and angles of closed loops are no free numbers
    for j, joint in enumerate(robot.joints if robot.constraints is None else ()):
        if joint.motion != "driven":
            continue  # a measured base is where it was measured
        base = "the base" if joint.parent < 0 else robot.joints[joint.parent].name
        way = f"from {base} to {joint.name}"
        for k, axis in enumerate(AXES):
            yield _cause(
                joint.name, f"correction of the length along {axis} {way}", "mm", _moved(j, k)
            )
        about = [_turned(j, k) for k in range(2)]
        tilted = f"the axis of {joint.name} is tilted by {{size}}"
        for k, axis in enumerate(AXES[:2]):
            what, phrase = (
                f"correction of the angle about {axis} {way}",
                f"{tilted} about its {axis}",
            )
            yield _cause(joint.name, what, "°", about[k], phrase=phrase)
        what = f"correction of the direction of its axis {way}"
        yield _cause(joint.name, what, "°", *about, phrase=tilted)
        if any(other.parent == j for other in robot.joints):
            alone = [_turned_alone(j, k) for k in range(2)]
            what = f"correction of the direction of its axis alone {way}"
            yield _cause(joint.name, what, "°", *alone, phrase=f"{tilted}, and nothing beyond it")
    slight = np.abs(robot.gravity) < UPRIGHT * np.linalg.norm(robot.gravity)
    tilts = {k: _tilted(k) for k in range(3) if slight[k]}
    for k, tilt in tilts.items():
        what = f"correction of the angle of the base about {AXES[k]}"
        yield _cause("", what, "°", tilt)
    if tilts:
        yield _cause("", "correction of the direction of gravity", "°", *tilts.values())


def rotation(axis: int, angle: float) -> np.ndarray:
    """Rotation about a coordinate axis by an angle [rad], shape (3, 3)."""
    i, j = (axis + 1) % 3, (axis + 2) % 3
    turn = np.eye(3)
    turn[[i, j], [i, j]] = np.cos(angle)
    turn[i, j], turn[j, i] = -np.sin(angle), np.sin(angle)
    return turn


def _cause(subject: str, what: str, unit: str, *changes: Change, phrase: str = "") -> Cause:
    """A cause of one change of the robot, or of several together."""
    scale, step = (MILLIMETRE if unit == "mm" else DEGREE), STEPS[unit]

    def columns(motion: RecordMotion) -> np.ndarray:
        others = [_regressor_after(change, step * scale, motion.regressor) for change in changes]
        added = np.array([motion.torque_by(other) for other in others]) - motion.torque
        size = np.abs(motion.torque).max(axis=-1, keepdims=True)
        added *= np.abs(added).max(axis=-1, keepdims=True) > ROUNDING * size
        return added / step

    def correct(problem: Problem, size: np.ndarray) -> Problem:
        robot = problem.robot
        for change, own in zip(changes, size, strict=True):
            robot = change(robot, float(own) * scale)
        return replace(problem, robot=robot)

    return Cause(
        "geometry",
        subject,
        what,
        unit,
        columns,
        len(changes),
        correct,
        LARGEST[unit],
        is_smooth=True,
        phrase=phrase,
    )


@lru_cache(maxsize=256)
def _regressor_after(change: Change, size: float, regressor: Regressor) -> Regressor:
    """That of the changed robot; angles about two axes are tried alone and together."""
    robot = change(regressor.robot, size)
    if robot.constraints is not None:
        return regressor_of(robot, regressor.parameters)
    return _with_all_entries(regressor).in_geometry_of(robot)


@lru_cache(maxsize=8)
def _with_all_entries(regressor: Regressor) -> Regressor:
    """Those besides that geometry alone hides."""
    return Regressor.build(regressor.robot, regressor.parameters, probed=False)


def _moved(joint: int, axis: int) -> Change:
    """The frame of a joint moved along an axis of its parent's link."""

    def change(robot: Robot, length: float) -> Robot:
        own = robot.joints[joint]
        translation = own.translation + length * np.eye(3)[axis]
        return _with_joint(robot, joint, replace(own, translation=translation))

    return change


def _turned(joint: int, axis: int) -> Change:
    """The frame of a joint turned about one of its own axes."""

    def change(robot: Robot, angle: float) -> Robot:
        own = robot.joints[joint]
        turned = own.rotation @ rotation(axis, angle)
        return _with_joint(robot, joint, replace(own, rotation=turned))

    return change


def _turned_alone(joint: int, axis: int) -> Change:
    """The same, while what the joint carries stays where it is as long as the joint is at zero."""

    def change(robot: Robot, angle: float) -> Robot:
        back = rotation(axis, -angle)
        for k, other in enumerate(robot.joints):
            if other.parent == joint:
                pose = back @ other.rotation, back @ other.translation
                other = replace(other, rotation=pose[0], translation=pose[1])
                robot = _with_joint(robot, k, other)
        return _turned(joint, axis)(robot, angle)

    return change


def _tilted(axis: int) -> Change:
    """Gravity turned about an axis of the base."""
    return lambda robot, angle: robot.with_gravity(rotation(axis, angle) @ robot.gravity)


def _with_joint(robot: Robot, index: int, joint) -> Robot:
    joints = list(robot.joints)
    joints[index] = joint
    return replace(robot, joints=tuple(joints))


def motion_causes(robot: Robot) -> Iterator[Cause]:
    """Zero position, scale and errors of each encoder, spring and play behind each motor.

    An encoder may also see a share of each other joint.
    """
    driven = [j for j, joint in enumerate(robot.joints) if joint.motion == "driven"]
    for j, other in permutations(driven, 2):
        yield _shared(robot.joints[j], robot.joints[other], j, other)
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


def _shared(joint: Joint, seen: Joint, j: int, other: int) -> Cause:
    """An encoder that reads q_j + s q_i: the joint is at what it reads less the share."""
    alike = joint.kind == seen.kind
    scale, unit = (PERCENT, "%") if alike else (1.0, f"{joint.position_unit}/{seen.position_unit}")
    return _misread(
        "encoder coupling",
        joint.name,
        f"share of {seen.name} that its encoder reads",
        unit,
        j,
        lambda m: (m.q[other], m.dq[other], m.ddq[other]),
        lambda size, q, every: q + size * every[:, other],
        -scale,
        largest=LARGEST["%"] if alike else np.inf,
        least_torque=NEGLIGIBLE,
        phrase=f"the encoder of {joint.name} turns with {{size}} of {seen.name}",
    )


def _shifted(name: str, j: int, scale: float, unit: str) -> Cause:
    return _misread(
        "zero position",
        name,
        "correction of the zero position",
        unit,
        j,
        lambda m: (np.ones_like(m.q[j]), np.zeros_like(m.q[j]), np.zeros_like(m.q[j])),
        lambda size, q, _: q + size,
        scale,
        largest=LARGEST[unit],
    )


def _scaled(name: str, j: int) -> Cause:
    return _misread(
        "position scale",
        name,
        "correction of the scale of the positions",
        "%",
        j,
        lambda m: (m.q[j], m.dq[j], m.ddq[j]),
        lambda size, q, _: q * (1.0 + size),
        PERCENT,
        largest=LARGEST["%"],
    )


def _misread(
    kind: str, name: str, what: str, unit: str, j: int,
    change: Callable[[RecordMotion], tuple[np.ndarray, np.ndarray, np.ndarray]],
    corrected: Callable[[float, np.ndarray, np.ndarray], np.ndarray],
    scale: float,
    **options: Any,
) -> Cause:  # fmt: skip
    """An encoder whose error follows from the positions.

    ``change``: δq and its derivatives per unit of size; ``corrected``: positions of the joint
    corrected, from the size, these and those of all joints; ``scale``: SI units of the unit.
    """

    def columns(motion: RecordMotion) -> np.ndarray:
        return scale * motion.along(j, change(motion), STEP)[None]

    def correct(problem: Problem, size: np.ndarray) -> Problem:
        return with_positions(problem, j, lambda q, every: corrected(scale * size[0], q, every))

    return Cause(kind, name, what, unit, columns, 1, correct, **options)


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
            problem, j, lambda q, _: q + a * np.sin(order * q) + b * np.cos(order * q), ref=False
        )

    often = "twice" if order == TURNS[1] else "once"
    what = f"correction of the encoder {often} per {words}"
    return Cause("encoder", name, what, "mrad", columns, 2, correct, LARGEST["mrad"])


def _behind_motor(
    name: str, j: int, kind: str, what: str, unit: str, error: Callable[[RecordMotion], np.ndarray],
    scale: float, least_torque: float = 0.0,
) -> Cause:  # fmt: skip
    """An error of the link's position that follows from the torque it carries."""

    def columns(motion: RecordMotion) -> np.ndarray:
        delta = -_within_band(error(motion), motion)
        speed = motion.derivative(delta)
        change = delta, speed, motion.derivative(speed)
        largest = max(float(np.abs(delta).max()), 1e-300)
        return scale * motion.along(j, change, STEP / largest, transmitted=True)[None]

    return Cause(
        kind,
        name,
        what,
        unit,
        columns,
        largest=LARGEST.get(unit, np.inf),
        is_positive=True,
        is_rough=True,
        least_torque=least_torque,
        by_effect=True,
    )


def _within_band(signal: np.ndarray, motion: RecordMotion) -> np.ndarray:
    """A signal as far as its frequencies may matter."""
    return butterworth(signal, motion.rate, WITHIN * motion.rate / SAMPLES_PER_PERIOD)


def _spring(name: str, j: int, turns: bool) -> Cause:
    unit = "µrad/(N m)" if turns else "µm/N"
    what = "compliance between motor and link"
    return _behind_motor(name, j, "elasticity", what, unit, lambda m: m.transmitted[j], MICRO)


def _play(name: str, j: int, turns: bool) -> Cause:
    unit = "mrad" if turns else "mm"

    def error(motion: RecordMotion) -> np.ndarray:
        pull = _within_band(motion.transmitted[j], motion) / np.maximum(
            motion.transmitted_by_acceleration(j), 1e-300
        )
        place = np.empty(pull.size)
        find_places_in_play(pull / (MILLI * PLAY[unit] * motion.rate**2), place)
        return place

    return _behind_motor(
        name, j, "backlash", "play behind the motor", unit, error, MILLI, NEGLIGIBLE
    )


@kernel
def find_places_in_play(pull: np.ndarray, place: np.ndarray) -> None:
    """Where a body is between two flanks, which it meets without a rebound.

    Args:
        pull: its acceleration while no flank holds it, in widths per squared sample, shape
            (samples,).
        place: receives ±1/2 at the flanks and what is between, likewise.
    """
    at, speed = np.copysign(0.5, pull[0]), 0.0
    for k in range(pull.size):
        speed += pull[k]
        at = min(max(at + speed, -0.5), 0.5)
        if abs(at) == 0.5:
            speed = 0.0
        place[k] = at


def with_torques(problem: Problem, j: int, made: Callable[[Recording], np.ndarray]) -> Problem:
    """The problem with other torques of one joint; ``made``: these, shape (samples,)."""

    def corrected(recording: Recording) -> Recording:
        tau = recording.tau.copy()
        tau[:, j] = made(recording)
        return replace(recording, tau=tau)

    return replace(problem, recordings=tuple(map(corrected, problem.recordings)))


def with_positions(problem: Problem, j: int, change: Correct, ref: bool = True) -> Problem:
    """The problem with one joint's positions corrected, and its reference with them."""

    def corrected(recording: Recording) -> Recording:
        q = recording.q.copy()
        q[:, j] = change(q[:, j], recording.q)
        reference = recording.q_ref
        if ref and reference is not None:
            every = reference
            reference = reference.copy()
            reference[:, j] = change(reference[:, j], every)
        return replace(recording, q=q, q_ref=reference)

    return replace(problem, recordings=tuple(corrected(r) for r in problem.recordings))
