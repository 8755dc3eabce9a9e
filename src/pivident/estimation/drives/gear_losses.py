"""Gain, efficiency, friction and rotor of each gear, from a torque before it and one behind it.

The motor's signal c and the torque τ_s of a sensor behind the gear belong to one motion:

    κ c = τ_s + µ |τ_s| sign(dq) + ia ddq + fv dq + fc sign(dq) + offset.

The gear takes the share µ of what it transmits, whichever way: its efficiency is 1/(1 + µ) when the
motor drives. Divided by κ the equation is linear, and needs no mass of the robot: the scale is that
of the sensor. Its noise would make 1/κ too small; instruments have the torque that the motion
predicts, by the model identified from the sensors, in place of τ_s (Young 2011, IV).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pivident.estimation.covariance.sandwich import sandwich
from pivident.estimation.covariance.windows import Windows
from pivident.estimation.drives.drive_equations import WINDOWS
from pivident.estimation.full_rate import valid_samples
from pivident.estimation.identify import identify, narrowed
from pivident.estimation.kinematics import estimate_kinematics
from pivident.estimation.normal_equations import JointSums
from pivident.estimation.problem import NOTHING_KNOWN, Problem
from pivident.estimation.signal_recipes import RandomWalk
from pivident.foundation.errors import ExperimentError, IdentificationError
from pivident.foundation.text.display import Displayed
from pivident.loop.motion.motion import residual_of, with_inner

#: What is found of a gear, in this order.
QUANTITIES = ("gain", "efficiency", "rotor inertia", "viscous", "Coulomb", "offset")


@dataclass(frozen=True, eq=False)
class GearLosses(Displayed):
    """One gear.

    Attributes:
        joint: name of the joint.
        values: gain [N m (or N) per unit of the log], efficiency, rotor inertia on the joint side,
            viscous and Coulomb friction, offset [SI], shape (6,).
        std: their standard errors, by windows of time, likewise.
        relative_error: share of the motor's torque that is left.
    """

    joint: str
    values: np.ndarray
    std: np.ndarray
    relative_error: float


def identify_gears(
    problem: Problem,
    sensors: Sequence[np.ndarray],
    progress: Callable[[str], None] | None = None,
) -> tuple[GearLosses, ...]:
    """All gears of a robot.

    Args:
        problem: robot and recordings, whose ``tau`` is the signal of the motors in any unit.
        sensors: torques behind the gears, for each recording, shape (samples, joints) [N m or N].
        progress: called with one line at each stage.

    Returns:
        One answer for each joint.

    Raises:
        ExperimentError: motors that share joints.
        IdentificationError: a joint that moves too little.
    """
    if problem.robot.couplings or problem.robot.base_joints:
        raise ExperimentError(
            "gears are compared joint by joint, but motors of this robot share joints, or its base "
            "moves",
            advice="leave [gains] sensors out",
        )
    say = progress or (lambda line: None)
    behind = tuple(
        replace(r, tau=own, torque_side="link", torque_scale=())
        for r, own in zip(problem.recordings, sensors, strict=True)
    )
    link = replace(
        problem, recordings=behind, loop=None, parameters=None, initial={}, **NOTHING_KNOWN
    )
    found = identify(link, "ls", lambda line: say(f"sensors: {line}"))
    regressor = narrowed(link, found).regressor
    count = WINDOWS * len(behind)
    sums = [JointSums.empty(name, np.arange(6), count) for name in problem.robot.joint_names]
    for k, (motors, felt) in enumerate(zip(problem.recordings, behind, strict=True)):
        moved, sensed = (estimate_kinematics(r, RandomWalk()) for r in (motors, felt))
        used = valid_samples(moved, moved.dq, problem.speed_limits(motors))
        predicted = sensed.tau - residual_of(regressor, with_inner(regressor, sensed), found.theta)
        windows = Windows(moved.q.shape[1], WINDOWS, k * WINDOWS)
        shares = list(windows.shares(slice(0, windows.samples)))
        for j, own in enumerate(sums):
            sign = np.sign(moved.dq[j])
            others = np.stack([moved.ddq[j], moved.dq[j], sign, np.ones_like(sign)])
            phi, z = (
                np.vstack([torque[j], np.abs(torque[j]) * sign, others])
                for torque in (sensed.tau, predicted)
            )
            own.add(phi, z, moved.tau[j], used[j], shares)
    return tuple(map(_solved, sums))


def _solved(own: JointSums) -> GearLosses:
    """κ and the losses from the coefficients of one row, by the delta method."""
    scale = np.sqrt(np.maximum(np.diag(own.ff), 1e-300))
    scaled = own.zf / np.outer(scale, scale)
    if own.rows < 100 or np.linalg.cond(scaled) > 1e8:
        raise IdentificationError(
            f"the motion of joint {own.name!r} does not separate gain and friction of its gear",
            advice="take a record in which it carries changing loads at changing speeds",
        )
    x = np.linalg.solve(scaled, own.zt / scale) / scale
    spread = sandwich([own], x, np.ones(1))
    gain, mu = 1.0 / x[0], x[1] / x[0]
    values = np.array([gain, 1.0 / (1.0 + mu), *(x[2:] * gain)])
    slopes = np.zeros((6, 6))
    slopes[0, 0] = -(gain**2)
    slopes[1, :2] = np.array([mu, -1.0]) * gain / (1.0 + mu) ** 2
    slopes[2:, 0], slopes[2:, 2:] = -x[2:] * gain**2, gain * np.eye(4)
    left = own.tt - 2.0 * x @ own.ft + x @ own.ff @ x
    std = np.sqrt(np.diag(slopes @ spread @ slopes.T))
    return GearLosses(own.name, values, std, float(np.sqrt(max(left, 0.0) / own.tt)))
