"""Torques that a controller adds from nominal parameters.

Evaluated on the reference they are known before the run, so they enter the simulated loop like any
other known input: added to the controller's output (divide by the drive gain where that is not a
torque). Gravity at the measured position is not known before; it becomes a part of the law.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pivident.dynamics.parameters import Parameter, nominal_values, standard_parameters
from pivident.dynamics.robot_regressor import regressor_of
from pivident.robot.description import Robot
from pivident.simulation.controllers import Controller, FeedForward
from pivident.simulation.gravity_compensation import GravityCompensated, GravityModel

if TYPE_CHECKING:
    from pivident.simulation.control_loop import Loop


def loop_feed_forward(
    robot: Robot, loop: Loop, reference: tuple[np.ndarray, np.ndarray, np.ndarray]
) -> np.ndarray | None:
    """Known inputs of a loop on its reference, (samples, joints) [unit of the controller's output].

    ``reference``: q, dq, ddq, each (samples, joints).
    """
    if loop.feed_forward in ("none", "gravity_measured"):  # that one is a part of the law
        return None
    standard = standard_parameters(robot)
    theta = nominal_values(robot, standard)
    if loop.feed_forward == "gravity":
        torque = gravity_feed_forward(robot, standard, theta, reference[0])
    else:
        torque = computed_torque_feed_forward(robot, standard, theta, *reference)
    return torque / np.asarray(loop.drive_gain)


def gravity_feed_forward(
    robot: Robot, parameters: tuple[Parameter, ...], theta: np.ndarray, q_ref: np.ndarray
) -> np.ndarray:
    """Torque that holds the robot at rest on its reference, shape (samples, joints) [N m or N].

    ``q_ref``: reference positions [rad or m], shape (samples, joints).
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

    ``q_ref``: reference positions [rad or m], shape (samples, joints). Result: torques or forces
    [N m or N].
    """
    return regressor_of(robot, parameters).torque(q_ref, dq_ref, ddq_ref, theta)


def with_measured_gravity(
    controller: Controller, robot: Robot, drive_gain: np.ndarray | float, kind: FeedForward
) -> Controller:
    """The law with the nominal robot's gravity at the measured position, where ``kind`` says so.

    ``drive_gain``: joint torque per controller output, shape (joints,) or a scalar.
    """
    if kind != "gravity_measured":
        return controller
    return GravityCompensated(controller, GravityModel.nominal(robot, drive_gain))
