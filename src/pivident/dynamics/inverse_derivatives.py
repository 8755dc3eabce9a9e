"""Derivatives of the inverse dynamics by position, speed and acceleration, for given parameters.

τ = ID(q, dq, ddq; θ) = M(q) ddq + h(q, dq) + friction: ∂τ/∂q and ∂τ/∂dq are found by one recursion
for all joints at once (``rigid_body_slopes``), ∂τ/∂ddq is the mass matrix M.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pivident.dynamics.column_slopes import column_slopes
from pivident.dynamics.forward import make_model, mass_matrix
from pivident.dynamics.kernels import link_poses
from pivident.dynamics.parameters import Parameter
from pivident.dynamics.regressor import Regressor
from pivident.dynamics.rigid_body_slopes import (
    move_links,
    place_links,
    slope_scratch,
    torque_slopes,
)
from pivident.foundation.compiled import kernel
from pivident.foundation.errors import UnusableValue
from pivident.robot.description import Robot
from pivident.robot.refusals import without_loops

#: What there is for a robot with closed loops.
DIFFERENCES = "take differences of the torques of pivident.dynamics.regressor_of"


class InverseDynamicsDerivatives(NamedTuple):
    """Derivatives of torques τ_j by the motion of joint k, each (samples, joints j, joints k).

    Attributes:
        position: ∂τ/∂q [N m/rad, N/m or mixed].
        speed: ∂τ/∂dq [N m s/rad, N s/m or mixed].
        acceleration: ∂τ/∂ddq = M(q) [kg m², kg or kg m].
    """

    position: np.ndarray
    speed: np.ndarray
    acceleration: np.ndarray


@kernel
def _along(tree, inertia, q, dq, ddq, pose, links, body, by_position, by_speed):
    for s in range(q.shape[0]):
        link_poses(tree.prismatic, tree.rotation, tree.translation, q[s], pose)
        place_links(tree.parent, tree.prismatic, pose, inertia, links, body)
        move_links(tree.parent, tree.gravity, dq[s], ddq[s], links, body)
        torque_slopes(tree.parent, tree.gravity, links, body, by_position[s], by_speed[s])


def inverse_dynamics_derivatives(
    robot: Robot,
    parameters: tuple[Parameter, ...],
    theta: np.ndarray,
    q: np.ndarray,
    dq: np.ndarray,
    ddq: np.ndarray,
) -> InverseDynamicsDerivatives:
    """∂ID/∂q, ∂ID/∂dq and ∂ID/∂ddq along a motion.

    Friction of speed and position, rotors and couplings are in it; the hard sign of a speed has
    the slope zero, and friction with memory or load counts as constant.

    Args:
        robot: the robot.
        parameters: standard parameters or heads of base groups; others count as zero.
        theta: their values, shape (parameters,).
        q: joint positions [rad or m], shape (samples, joints); ``dq ddq`` likewise.
        dq: joint speeds [rad/s or m/s].
        ddq: joint accelerations [rad/s² or m/s²].

    Returns:
        The three matrices at every sample.

    Raises:
        RobotDescriptionError: a robot with closed loops.
        UnusableValue: shapes that do not fit.
    """
    without_loops(robot, "the derivative of the inverse dynamics", DIFFERENCES)
    n = robot.size
    wanted = (len(q), n)
    if any(np.shape(x) != wanted for x in (q, dq, ddq)):
        shapes = ", ".join(str(np.shape(x)) for x in (q, dq, ddq))
        raise UnusableValue(f"arrays have shapes {shapes}, (samples, joints) = {wanted} is needed")
    if np.shape(theta) != (len(parameters),):
        raise UnusableValue(
            f"theta has shape {np.shape(theta)}", advice=f"{(len(parameters),)} is needed"
        )
    q, dq, ddq = (np.ascontiguousarray(x, dtype=float) for x in (q, dq, ddq))
    model = make_model(robot, parameters, theta, clip=True)
    by_position, by_speed = np.zeros((len(q), n, n)), np.zeros((len(q), n, n))
    scratch = np.zeros((n, 12)), *slope_scratch(n)
    _along(model.tree, model.inertia, q, dq, ddq, *scratch, by_position, by_speed)
    for slope in column_slopes(Regressor.build(robot, parameters)):
        if slope.quantity > 1:
            continue
        value = theta[slope.column] * slope.value(
            q[:, slope.motion_of], dq[:, slope.motion_of], dq[:, slope.other]
        )
        out = by_position if slope.quantity == 0 else by_speed
        out[:, slope.joint, slope.motion_of] += value
        if slope.ratio:
            out[:, slope.joint, slope.other] += slope.ratio * value
    return InverseDynamicsDerivatives(
        by_position, by_speed, mass_matrix(robot, parameters, theta, q)
    )
