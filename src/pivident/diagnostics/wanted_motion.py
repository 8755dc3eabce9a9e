"""Which motion would determine a parameter that this one does not?

A parameter's column of the observation matrix is made of postures (gravity, offsets), speeds
(friction, centrifugal torque) or accelerations (inertia). The part that is largest in motions
within the robot's limits says what to do, and the joints that have room for it, where.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pivident.dynamics.parameters import Parameter
from pivident.dynamics.robot_regressor import closing_states, moving_joints, regressor_of
from pivident.estimation.identification import Identification
from pivident.robot.description import Robot

#: Time in which a joint usually reaches its rated speed [s].
RISE = 0.25

#: A joint that used less than this share of what it can do has room for more.
LITTLE = 0.5

#: Random motions from which a column's parts are judged.
SAMPLES = 400

_SENTENCES = (
    "let {joints} hold more postures against gravity, with slow moves between them",
    "move {joints} faster and in both directions",
    "accelerate {joints} harder, in different postures",
    "move {joints} slowly through more of its range",
)

#: Sentence for ripple and springs, which posture shows, but not against gravity.
_OWN_POSITION = 3


@dataclass(frozen=True, eq=False)
class Limits:
    """What a robot can do, as far as its description or its record shows."""

    low: np.ndarray  # least positions [rad or m], shape (joints,)
    high: np.ndarray  # largest positions
    speed: np.ndarray  # largest speeds [rad/s or m/s]
    acceleration: np.ndarray  # usual largest accelerations [rad/s² or m/s²]
    #: Shares of the ranges of position, speed and acceleration that a motion used, shape
    #: (joints, 3).
    used: np.ndarray

    @classmethod
    def of(cls, robot: Robot, q: np.ndarray, dq: np.ndarray, ddq: np.ndarray) -> Limits:
        """Limits of a robot, from a motion where the robot does not give them.

        ``q``: positions of a motion, shape (samples, joints); ``dq`` and ``ddq`` likewise.
        """
        room = [0.5 if joint.kind == "revolute" else 0.1 for joint in robot.joints]
        bounds = [
            joint.position_limits or (float(x.min()) - r, float(x.max()) + r)
            for joint, x, r in zip(robot.joints, q.T, room, strict=True)
        ]
        low, high = np.array(bounds, dtype=float).T
        moved = np.abs(dq).max(axis=0)
        speed = np.where(np.isfinite(robot.rated_speeds), robot.rated_speeds, moved)
        speed = np.maximum(speed, 1e-12)
        acceleration = speed / RISE
        used = [
            np.ptp(q, axis=0) / np.maximum(high - low, 1e-12),
            moved / speed,
            np.abs(ddq).max(axis=0) / acceleration,
        ]
        return cls(low, high, speed, acceleration, np.column_stack(used))


def column_parts(robot: Robot, parameters: tuple[Parameter, ...], limits: Limits) -> np.ndarray:
    """Rms of each parameter's column by posture, speed and acceleration, shape (parameters, 3)."""
    rng = np.random.default_rng(1988)
    shape = (SAMPLES, robot.size)
    q = rng.uniform(limits.low, limits.high, shape)
    dq = rng.uniform(-limits.speed, limits.speed, shape)
    ddq = rng.uniform(-limits.acceleration, limits.acceleration, shape)
    q, dq, ddq = closing_states(robot, q, dq, ddq)
    still = np.zeros(q.shape)
    regressor = regressor_of(robot, parameters)
    # friction with memory or load shows in steady motion, not at random states
    level, none = regressor.levels(dq.T), regressor.levels(still.T)
    rest = regressor.matrix(q, still, still, inner=none)
    moving = regressor.matrix(q, dq, still, inner=level)
    accelerated = regressor.matrix(q, still, ddq, inner=none)
    parts = (rest - rest.mean(axis=0), moving - rest, accelerated - rest)
    return np.column_stack([np.sqrt(np.mean(p**2, axis=0).max(axis=0)) for p in parts])


def motion_for(
    robot: Robot, parameter: Parameter, parts: np.ndarray, limits: Limits
) -> tuple[int, tuple[str, ...]]:
    """Quantity and joints that would excite a parameter.

    Quantities are 0 posture, 1 speed, 2 acceleration, 3 position of the joint alone.

    ``parts``: of its column, see :func:`column_parts`, shape (3,).
    """
    moving = moving_joints(robot, parameter)
    driven = [j for j in moving if robot.joints[j].motion == "driven"]
    # no motor moves a base; of a robot on planted feet its pose is all that there is to name
    joints = driven or [*range(robot.base_joints, robot.size)] or [*moving]
    own = [j for j, place in enumerate(robot.places) if place == parameter.joint and j in joints]
    # an offset has a constant column: motion in both directions separates it from Coulomb friction
    quantity = 1 if parameter.stem == "off" else int(np.argmax(parts))
    room = [j for j in joints if limits.used[j, quantity] < LITTLE] or own or joints
    if parameter.friction is not None and parameter.friction.depends_on_position:
        quantity = _OWN_POSITION
    return quantity, tuple(robot.joints[j].name for j in room)


def wanted_motions(identification: Identification, names: tuple[str, ...]) -> tuple[str, ...]:
    """Motions that would determine some parameters, one sentence for each kind of motion."""
    if not names or not identification.recordings:
        return ()
    robot = identification.robot
    records = identification.recordings
    motion = (np.vstack([getattr(r, name) for r in records]) for name in ("q", "dq", "ddq"))
    limits = Limits.of(robot, *motion)
    chosen = [identification.names.index(name) for name in names]
    heads = tuple(identification.parameters[k] for k in chosen)
    parts = column_parts(robot, heads, limits)

    def in_order(joints: set[str]) -> str:
        return ", ".join(name for name in robot.joint_names if name in joints)

    groups: dict[int, tuple[list[str], set[str]]] = {}
    for name, head, part in zip(names, heads, parts, strict=True):
        quantity, joints = motion_for(robot, head, part, limits)
        members, moved = groups.setdefault(quantity, ([], set()))
        members.append(name)
        moved.update(joints)
    return tuple(
        f"For {', '.join(members)}: {_SENTENCES[quantity].format(joints=in_order(moved))}."
        for quantity, (members, moved) in sorted(groups.items())
    )
