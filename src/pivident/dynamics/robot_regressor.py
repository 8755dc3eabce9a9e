"""The observation matrix of any robot."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pivident.dynamics.parameters import Parameter
from pivident.dynamics.regressor import Regressor
from pivident.foundation.common_work import once
from pivident.foundation.errors import RobotDescriptionError
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
    own = tuple(parameters)
    if robot.constraints is None:
        return once(("regressor", robot, own), lambda: Regressor.build(robot, own))
    from pivident.dynamics.closed_chains.closed_regressor import ClosedRegressor

    return once(("regressor", robot, own), lambda: ClosedRegressor.of(robot, own))


def closing_states(robot: Robot, q: np.ndarray, *others: np.ndarray) -> tuple[np.ndarray, ...]:
    """States drawn at random without those at which loops do not close; a held base stands still.

    Args:
        robot: the robot.
        q: positions [rad or m], shape (samples, joints).
        others: what belongs to them, samples first.

    Raises:
        RobotDescriptionError: the loops close at none of them.
    """
    if robot.base_motion == "held":
        moves = np.arange(robot.size) >= robot.base_joints
        return tuple(x * moves for x in (q, *others))
    if robot.constraints is None:
        return (q, *others)
    from pivident.dynamics.closed_chains.closed_motion import ClosedChains

    closes = ClosedChains(robot).closing(q)
    if not closes.any():
        raise RobotDescriptionError(
            f"the loops of robot {robot.name!r} close at none of {len(q)} postures between the "
            "limits of its joints",
            advice="give position_limits within which they do",
        )
    return tuple(x[closes] for x in (q, *others))


def moving_joints(robot: Robot, parameter: Parameter) -> tuple[int, ...]:
    """Indices of the joints whose motion a parameter's torque comes from, ascending."""
    tree, coupling = robot.tree, parameter.coupling
    if coupling is not None:
        joints = [coupling.motor, coupling.joint]
    elif parameter.is_inertial:
        joints = sorted(tree.ancestors(parameter.joint))
    else:
        joints = [parameter.joint]
    if robot.constraints is None:
        return tuple(joints)
    from pivident.dynamics.closed_chains.closed_motion import moved_joints

    return tuple(np.flatnonzero(moved_joints(robot)[joints].any(axis=0)).tolist())
