"""The observation matrix of any robot."""

from __future__ import annotations

from collections.abc import Sequence

from pivident.dynamics.closed_regressor import ClosedRegressor
from pivident.dynamics.parameters import Parameter
from pivident.dynamics.regressor import Regressor
from pivident.robot.description import Robot


def regressor_of(robot: Robot, parameters: Sequence[Parameter]) -> Regressor:
    """Φ of a robot for chosen parameters: of a tree, or Nᵀ Y of a mechanism with closed loops.

    Args:
        robot: the robot.
        parameters: columns of the observation matrix, in their order.

    Returns:
        The regressor, which knows where entries can be non-zero.

    Raises:
        RobotDescriptionError: friction that closed loops do not handle.
    """
    if robot.constraints is None:
        return Regressor.build(robot, parameters)
    return ClosedRegressor.of(robot, parameters)
