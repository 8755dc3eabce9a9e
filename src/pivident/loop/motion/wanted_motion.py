"""Which motion would determine a parameter that this one does not?

A parameter's column of the observation matrix is made of postures (gravity, offsets), speeds
(friction, centrifugal torque) or accelerations (inertia). The part that is largest in motions
within the robot's limits says what to do. A joint takes part in it if its own motion changes that
part: no turn about a vertical axis is a posture against gravity. Those that have room for more say
where.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pivident.dynamics.parameters import Parameter
from pivident.dynamics.regressor import Regressor
from pivident.dynamics.robot_regressor import closing_states, moving_joints, regressor_of
from pivident.robot.description import Robot

#: Time in which a joint is taken to reach its rated speed where no acceleration is given [s].
RISE = 0.25

#: A joint that used less than this share of what it can do has room for more.
LITTLE = 0.5

#: Share of a part that a joint takes part in, relative to the joint that has most of it.
TAKES_PART = 0.05

#: Random motions from which a column's parts are judged.
SAMPLES = 400

#: Kinds of motion, and the columns of ``FullMotion.parts``.
POSTURE, SPEED, ACCELERATION = 0, 1, 2

#: Motion for ripple and springs, which posture shows, but not against gravity.
OWN_POSITION = 3

SENTENCES = (
    "let {joints} hold more postures against gravity, with slow moves between them",
    "move {joints} faster and in both directions",
    "accelerate {joints} harder, in different postures",
    "move {joints} slowly through more of its range",
)


@dataclass(frozen=True, eq=False)
class MotionLimits:
    """What a robot can do, as far as its description or its record shows, and what was used of it.

    Attributes:
        low, high: least and largest positions [rad or m], shape (joints,).
        speed: largest speeds [rad/s or m/s], shape (joints,).
        acceleration: usual largest accelerations [rad/s² or m/s²], shape (joints,).
        used: shares of the ranges of position, speed and acceleration that a motion used, shape
            (joints, 3).
    """

    low: np.ndarray
    high: np.ndarray
    speed: np.ndarray
    acceleration: np.ndarray
    used: np.ndarray

    @classmethod
    def of(cls, robot: Robot, q: np.ndarray, dq: np.ndarray, ddq: np.ndarray) -> MotionLimits:
        """Limits of a robot, from a motion where the robot does not give them.

        Args:
            robot: the robot.
            q: positions of a motion [rad or m], shape (samples, joints).
            dq: speeds, likewise.
            ddq: accelerations, likewise.
        """
        revolute = np.array([joint.kind == "revolute" for joint in robot.joints])
        least, most, span = q.min(axis=0), q.max(axis=0), np.where(revolute, np.pi, 1.0)
        room = np.where(revolute, 0.5, 0.1)
        low, high = least - room, most + room
        for j, joint in enumerate(robot.joints):
            if joint.position_limits:
                low[j], high[j] = joint.position_limits
                span[j] = high[j] - low[j]
        moved = np.abs(dq).max(axis=0)
        speed = np.where(np.isfinite(robot.rated_speeds), robot.rated_speeds, moved)
        speed = np.where(speed > 0.0, speed, 1.0)
        acceleration = speed / RISE
        used = [
            (most - least) / np.maximum(span, 1e-12),
            moved / speed,
            np.abs(ddq).max(axis=0) / acceleration,
        ]
        return cls(low, high, speed, acceleration, np.column_stack(used))


@dataclass(frozen=True, eq=False)
class FullMotion:
    """Random states of a robot within its limits, and parts of the columns there.

    Attributes:
        robot: the robot.
        q, dq, ddq: states, shape (samples, joints).
    """

    robot: Robot
    q: np.ndarray
    dq: np.ndarray
    ddq: np.ndarray

    @classmethod
    def within(cls, robot: Robot, limits: MotionLimits) -> FullMotion:
        """States drawn evenly within limits; those of a mechanism where its loops close."""
        rng, shape = np.random.default_rng(1988), (SAMPLES, robot.size)
        q = rng.uniform(limits.low, limits.high, shape)
        dq = rng.uniform(-limits.speed, limits.speed, shape)
        ddq = rng.uniform(-limits.acceleration, limits.acceleration, shape)
        return cls(robot, *closing_states(robot, q, dq, ddq))

    def columns(self, parameters: Sequence[Parameter]) -> np.ndarray:
        """Φ at the states, shape (samples, joints, parameters)."""
        return _columns(regressor_of(self.robot, parameters), self.q, self.dq, self.ddq)

    def parts(self, parameters: Sequence[Parameter]) -> np.ndarray:
        """Rms of each column by posture, speed and acceleration, shape (parameters, 3)."""
        regressor, still = regressor_of(self.robot, parameters), np.zeros(self.q.shape)
        rest = _columns(regressor, self.q, still, still)
        moving = _columns(regressor, self.q, self.dq, still)
        accelerated = _columns(regressor, self.q, still, self.ddq)
        changes = (rest - rest.mean(axis=0), moving - rest, accelerated - rest)
        return np.column_stack([_rms(change) for change in changes])

    def parts_by_joint(self, parameters: Sequence[Parameter]) -> np.ndarray:
        """Rms of what each joint alone changes in these parts, shape (parameters, 3, joints).

        The loops of a mechanism do not close at every posture, least of all where one joint has
        moved alone: there each joint counts as if it changed all of the posture's part.
        """
        regressor, still = regressor_of(self.robot, parameters), np.zeros(self.q.shape)
        found = np.zeros((len(parameters), 3, self.robot.size))
        rest = _columns(regressor, self.q, still, still)
        moving = _columns(regressor, self.q, self.dq, still)
        for j in range(self.robot.size):
            if self.robot.constraints is None:
                elsewhere = self.q.copy()
                elsewhere[:, j] = np.roll(self.q[:, j], 1)
                found[:, POSTURE, j] = _rms(_columns(regressor, elsewhere, still, still) - rest)
            else:
                found[:, POSTURE, j] = _rms(rest - rest.mean(axis=0))
            others, alone = self.dq.copy(), still.copy()
            others[:, j], alone[:, j] = 0.0, self.ddq[:, j]
            found[:, SPEED, j] = _rms(moving - _columns(regressor, self.q, others, still))
            found[:, ACCELERATION, j] = _rms(_columns(regressor, self.q, still, alone) - rest)
        return found


def _columns(regressor: Regressor, q: np.ndarray, dq: np.ndarray, ddq: np.ndarray) -> np.ndarray:
    """Φ; friction with memory or load as in steady motion: states do not follow each other."""
    return regressor.matrix(q, dq, ddq, inner=regressor.levels(dq.T))


def _rms(columns: np.ndarray) -> np.ndarray:
    """Rms over the samples, that of the joint where it is largest, shape (parameters,)."""
    return np.sqrt(np.mean(columns**2, axis=0).max(axis=0))


@dataclass(frozen=True)
class WantedMotion:
    """What would excite a parameter.

    Attributes:
        kind: POSTURE, SPEED, ACCELERATION or OWN_POSITION.
        joints: names of the joints that should do it, in the robot's order.
    """

    kind: int
    joints: tuple[str, ...]

    def __str__(self) -> str:
        """As an instruction that begins in lower case and has no full stop."""
        return SENTENCES[self.kind].format(joints=", ".join(self.joints))


def motions_for(
    parameters: Sequence[Parameter], full: FullMotion, limits: MotionLimits
) -> list[WantedMotion]:
    """The motion that would excite each of some parameters.

    Args:
        parameters: those that a motion determined too little.
        full: motion of the robot within its limits.
        limits: and what was used of them.
    """
    if not parameters:
        return []
    parts, by_joint = full.parts(parameters), full.parts_by_joint(parameters)
    return [
        _motion_for(full.robot, parameter, own, shares, limits)
        for parameter, own, shares in zip(parameters, parts, by_joint, strict=True)
    ]


def _motion_for(
    robot: Robot,
    parameter: Parameter,
    parts: np.ndarray,
    by_joint: np.ndarray,
    limits: MotionLimits,
) -> WantedMotion:
    """``parts``: of its column, shape (3,); ``by_joint``: of each joint in them, (3, joints)."""
    moving = moving_joints(robot, parameter)
    driven = [j for j in moving if robot.joints[j].motion == "driven"]
    # no motor moves a base; of a robot on planted feet its pose is all that there is to name
    joints = driven or [*range(robot.base_joints, robot.size)] or [*moving]
    # an offset has a constant column: motion in both directions separates it from Coulomb friction
    kind = SPEED if parameter.stem == "off" else int(np.argmax(parts))
    least = TAKES_PART * by_joint[kind, joints].max()
    joints = [j for j in joints if by_joint[kind, j] >= least]
    own = [j for j, place in enumerate(robot.places) if place == parameter.joint and j in joints]
    room = [j for j in joints if limits.used[j, kind] < LITTLE] or own or joints
    if parameter.friction is not None and parameter.friction.depends_on_position:
        kind = OWN_POSITION
    return WantedMotion(kind, tuple(robot.joints[j].name for j in room))
