"""Models that only mechanisms with closed loops have: their equations, and how all joints move."""

from __future__ import annotations

import numpy as np

from pivident.errors import RobotDescriptionError
from pivident.robot.description import Robot
from pivident.symbolic.assignments import Output, output_array
from pivident.symbolic.closed_symbols import closed_symbols
from pivident.symbolic.closures import closing_equations, jacobian
from pivident.symbolic.model_symbols import NOTHING, bare_symbols
from pivident.symbolic.program import Program


def closure_equations(robot: Robot) -> Program:
    """Equations c(q) = 0 that close the loops, and A = ∂c/∂q, as a program.

    Its argument are positions of all joints of the tree, whether or not the loops are closed there.
    Equations that follow from others are left out.

    Args:
        robot: with closed loops, or joints that move in proportion.

    Returns:
        The program.

    Raises:
        RobotDescriptionError: the robot is a tree.
    """
    _with_loops(robot)
    assert robot.constraints is not None
    model = bare_symbols(robot.tree)
    equations = closing_equations(model, robot.constraints)
    names = [robot.constraints.names[k] for k in robot.constraints.kept]
    left_out = ", ".join(robot.constraints.redundant)
    notes = ["Equations: " + ", ".join(names)]
    if left_out:
        notes.append(f"Left out, because they follow from these: {left_out}")
    return Program.build(
        "closure_equations",
        model.inputs("q"),
        NOTHING,
        [
            Output(
                "gap",
                output_array([equation.gap() for equation in equations]),
                "c(q), zero where the loops are closed [m, rad or 1]",
            ),
            Output(
                "jacobian",
                jacobian(equations, model, closed=False),
                "A = dc/dq, row by row",
            ),
        ],
        title=f"Equations that close the loops of {robot.name}",
        notes=notes,
    )


def joint_motion(robot: Robot) -> Program:
    """Motion of all joints from that of the independent ones, as a program.

    Positions, speeds N dq_a and accelerations N ddq_a + γ of all joints of the tree, and N.

    Args:
        robot: with closed loops, or joints that move in proportion.

    Returns:
        The program.

    Raises:
        RobotDescriptionError: the robot is a tree.
    """
    _with_loops(robot)
    model = closed_symbols(robot)
    assert model.gain is not None
    order = ", ".join(joint.name for joint in robot.tree.joints)
    return Program.build(
        "joint_motion",
        model.inputs("q", "dq", "ddq"),
        NOTHING,
        [
            Output("positions", output_array(model.q), "positions of all joints [rad or m]"),
            Output("speeds", output_array(model.dq), "their speeds [rad/s or m/s]"),
            Output("accelerations", output_array(model.ddq), "likewise [rad/s^2 or m/s^2]"),
            Output("gain", np.array(model.gain), "N with dq = N dq_a, row by row"),
        ],
        title=f"Motion of all joints of {robot.name}",
        hints=model.hints,
        notes=[f"All joints: {order}"],
        closing=model.closing,
    )


def _with_loops(robot: Robot) -> None:
    if robot.constraints is None:
        raise RobotDescriptionError(
            f"robot {robot.name!r} has no closed loops and no joints that follow others, so there "
            "are no equations that close them; leave out closure and motion"
        )
