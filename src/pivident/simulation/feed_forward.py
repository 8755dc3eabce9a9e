"""Feed-forward torques from nominal parameters, evaluated on the reference.

They are known before the run, so they enter the simulated loop like any other known input: added
to the controller's output (divide by the drive gain where that is not a torque).
"""

from __future__ import annotations

import numpy as np

from pivident.dynamics.parameters import Parameter
from pivident.dynamics.regressor import Regressor
from pivident.robot.description import Robot


def gravity_feed_forward(
    robot: Robot, parameters: tuple[Parameter, ...], theta: np.ndarray, q_ref: np.ndarray
) -> np.ndarray:
    """Torque that holds the robot at rest on its reference, shape (samples, joints) [N m or N].

    Args:
        robot: the robot.
        parameters: standard parameters or heads of base groups.
        theta: their nominal values, shape (parameters,).
        q_ref: reference positions [rad or m], shape (samples, joints).
    """
    still = np.zeros_like(q_ref)
    return computed_torque_feed_forward(robot, parameters, theta, q_ref, still, still)


def computed_torque_feed_forward(
    robot: Robot,
    parameters: tuple[Parameter, ...],
    theta: np.ndarray,
    q_ref: np.ndarray,
    dq_ref: np.ndarray,
    ddq_ref: np.ndarray,
) -> np.ndarray:
    """Inverse dynamics of the reference, Φ(q_ref, dq_ref, ddq_ref) θ, shape (samples, joints).

    Args:
        robot: the robot.
        parameters: standard parameters or heads of base groups.
        theta: their nominal values, shape (parameters,).
        q_ref: reference positions [rad or m], shape (samples, joints).
        dq_ref: reference speeds, likewise.
        ddq_ref: reference accelerations, likewise.

    Returns:
        Torques or forces [N m or N].
    """
    return Regressor.build(robot, parameters).torque(q_ref, dq_ref, ddq_ref, theta)
