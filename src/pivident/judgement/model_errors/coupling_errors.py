"""Joints that are tied to one another otherwise than the description says.

A loop that is not described, a motor that sits on another link or turns against another one, or
an angle that is counted from another link leave energies in the residual that belong to several
joints at once. Of two joints they are, with phases φ = q,

    T = b(φ_i, φ_k) dq_i dq_k,    V = c(φ_i, φ_k)

with b a constant and the cosines and sines of sum and difference, c these and those of each joint.
Lagrange's equations make of them

    τ_i = b ddq_k + ∂b/∂q_k dq_k² + ∂c/∂q_i,    τ_k = b ddq_i + ∂b/∂q_i dq_i² + ∂c/∂q_k

which of planar linkages with parallel rods is all there is. Where loops tie three joints, as those
of a Delta robot, no pair of them explains much before the other pairs are known. Of three joints
together b is a constant, and c the product of their positions from the middle, for each pair.
What a tree's own parameters can make of these lies in the space of Φ and is not counted.

A motor that turns with two joints rubs with the sum or the difference of their speeds. And where
positions were converted from motors to joints but torques were not, a joint's torque has a part of
another one's, r τ_k in τ_i.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations, permutations

import numpy as np

from pivident.foundation.text.sentences import listed
from pivident.judgement.model_errors.cause import Cause, Columns, Reach, RecordMotion, on_joint
from pivident.judgement.model_errors.motion_errors import PERCENT
from pivident.robot.description import Robot

#: Kind of these causes.
COUPLED = "coupled joints"

#: Phase of a sliding joint at the end of its travel, from the middle [rad]; that of one that turns
#: is its angle.
END = 0.5

#: Share of the residual from which on one is named, and share of the torque of a joint: a few per
#: cent of a residual go along with the motion of several joints for many reasons.
LEAST, LEAST_TORQUE = 0.1, 0.003

#: Multiples of both phases in b and c: constant, difference, sum, each of both.
DIFFERENCE, SUM, FIRST, SECOND = (1.0, -1.0), (1.0, 1.0), (1.0, 0.0), (0.0, 1.0)


def coupling_causes(robot: Robot, reach: Reach) -> Iterator[Cause]:
    """Each pair of joints, each three of which none carries another, motors and torques of two.

    Args:
        robot: the robot as described.
        reach: where its joints went.

    Of a robot on a measured base none: force and moment on the base check how its joints are tied.
    """
    if robot.base_joints:
        return
    names = robot.joint_names
    phases = Phases.of(robot, reach)
    shared = "inertia and weight that belong to all of them"
    for pair in combinations(range(robot.size), 2):
        yield _cause([names[j] for j in pair], shared, _Pair(phases, *pair), 13, is_smooth=True)
    for three in combinations(range(robot.size), 3):
        carried = ((robot.places[i], robot.places[k]) for i, k in combinations(three, 2))
        if not any(i in robot.tree.ancestors(k) for i, k in carried):  # loops cut
            columns = _Three(phases, three)
            yield _cause([names[j] for j in three], shared, columns, 6, is_smooth=True)
    for i, k in permutations(range(robot.size), 2):
        if robot.torque_side == "motor":
            sign, word = (1.0, "sum") if i < k else (-1.0, "difference")
            what = f"friction of a motor that turns with the {word} of both"
            motor = _Motor(_slope(robot, i, k), sign, i, k)
            yield _cause(sorted((names[i], names[k]), key=names.index), what, motor, 2)
        what = f"a part of the torque of {names[k]} in that of {names[i]}"
        yield _cause([names[i], names[k]], what, _Torque(i, k), 1, unit="%")


@dataclass(frozen=True)
class Phases:
    """φ = (q - middle) scale + at: shape (joints,) each."""

    middle: np.ndarray
    scale: np.ndarray
    at: np.ndarray

    @classmethod
    def of(cls, robot: Robot, reach: Reach) -> Phases:
        """Angles where a joint turns; where it slides, `END` at the ends of its travel."""
        middle, half = 0.5 * (reach.low + reach.high), 0.5 * (reach.high - reach.low)
        turns = np.array([joint.kind == "revolute" for joint in robot.joints])
        scale = np.where(turns, 1.0, END / np.maximum(half, 1e-300))
        return cls(middle, scale, np.where(turns, middle, 0.0))


@dataclass(frozen=True)
class _Pair:
    """Torques of the energies of two joints, one row each; shape (13, joints, samples)."""

    phases: Phases
    i: int
    k: int

    def __call__(self, motion: RecordMotion) -> np.ndarray:
        i, k, p = self.i, self.k, self.phases
        x, y = ((motion.q[j] - p.middle[j]) * p.scale[j] + p.at[j] for j in (i, k))
        out = np.zeros((13, *motion.q.shape))
        out[0, i], out[0, k] = motion.ddq[k], motion.ddq[i]
        made = iter(out[1:])
        for m, n in (DIFFERENCE, SUM):
            for phase in (0.0, 0.5 * np.pi):
                value, slope = np.cos(m * x + n * y - phase), -np.sin(m * x + n * y - phase)
                own = next(made)
                own[i] = value * motion.ddq[k] + n * p.scale[k] * slope * motion.dq[k] ** 2
                own[k] = value * motion.ddq[i] + m * p.scale[i] * slope * motion.dq[i] ** 2
        for m, n in (DIFFERENCE, SUM, FIRST, SECOND):
            for phase in (0.0, 0.5 * np.pi):
                slope = -np.sin(m * x + n * y - phase)
                own = next(made)
                own[i], own[k] = m * p.scale[i] * slope, n * p.scale[k] * slope
        return out


@dataclass(frozen=True)
class _Three:
    """Torques of dq_i dq_k and of products of positions, shape (6, joints, samples)."""

    phases: Phases
    joints: tuple[int, int, int]

    def __call__(self, motion: RecordMotion) -> np.ndarray:
        away = motion.q - self.phases.middle[:, None]
        out = np.zeros((6, *motion.q.shape))
        made = iter(out)
        for i, k in combinations(self.joints, 2):
            for signal in (motion.ddq, away):
                own = next(made)
                own[i], own[k] = signal[k], signal[i]
        return out


@dataclass(frozen=True)
class _Motor:
    """Viscous and dry friction over dq_i ± dq_k, shape (2, joints, samples)."""

    slope: float
    sign: float
    i: int
    k: int

    def __call__(self, motion: RecordMotion) -> np.ndarray:
        speed = motion.dq[self.i] + self.sign * motion.dq[self.k]
        out = np.zeros((2, *motion.q.shape))
        out[:, self.i] = speed, 2.0 / np.pi * np.arctan(self.slope * speed)
        out[:, self.k] = self.sign * out[:, self.i]
        return out


@dataclass(frozen=True)
class _Torque:
    """A per cent of τ_k on joint i, shape (1, joints, samples)."""

    i: int
    k: int

    def __call__(self, motion: RecordMotion) -> np.ndarray:
        return on_joint(self.i, [PERCENT * motion.torque[self.k]], motion)


def _slope(robot: Robot, *joints: int) -> float:
    """Slope of the smoothed sign of a motor's friction: the flatter one of its joints' [s/rad]."""
    own = [robot.joints[j] for j in joints]
    return min(max(joint.friction.slopes, default=joint.default_gamma) for joint in own)


def _cause(
    names: list[str],
    what: str,
    columns: Columns,
    count: int,
    unit: str = "",
    is_smooth: bool = False,
) -> Cause:
    return Cause(
        COUPLED,
        listed(names),
        what,
        unit,
        columns,
        count,
        is_smooth=is_smooth,
        least=LEAST,
        least_torque=LEAST_TORQUE,
    )
