"""All symbolic models of a robot, and the files that they are written to."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial

import numpy as np

from pivident.dynamics.base_parameters import BaseParameters, base_parameters
from pivident.dynamics.grouping.closed_form import (
    ClosedFormBaseParameters,
    closed_form_base_parameters,
)
from pivident.dynamics.grouping.expression_graph import Expression, symbol
from pivident.dynamics.parameters import nominal_values, standard_parameters
from pivident.foundation.errors import RobotDescriptionError
from pivident.foundation.text.identifiers import identifier
from pivident.models.symbolic.assignments import Input, Output, output_array
from pivident.models.symbolic.closed_symbols import closed_symbols
from pivident.models.symbolic.closures import closing_equations, jacobian
from pivident.models.symbolic.composite_bodies import gravity_vector, mass_matrix
from pivident.models.symbolic.model_symbols import NOTHING, Columns, bare_symbols
from pivident.models.symbolic.newton_euler import coriolis_vector, inverse_model, observation_matrix
from pivident.models.symbolic.print_c import c_header, c_source
from pivident.models.symbolic.print_python import python_module, sympy_module
from pivident.models.symbolic.program import Program, latex_document
from pivident.robot.description import Robot


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
            "are no equations that close them",
            advice="leave out closure and motion",
        )


#: Models that can be written, and their description.
MODELS = {
    "inverse": "inverse model tau(q, dq, ddq)",
    "regressor": "observation matrix phi(q, dq, ddq)",
    "mass": "mass matrix",
    "gravity": "torques against gravity",
    "coriolis": "torques of Coriolis and centrifugal forces",
    "base": "base parameters from standard ones",
}

#: Models that only robots with closed loops, or joints that follow others, have.
LOOP_MODELS = {
    "closure": "equations that close the loops, and their Jacobian",
    "motion": "motion of all joints from that of the independent ones",
}

#: Languages, and the suffix of the robot's name in their files.
LANGUAGES = {"python": ".py", "c": ".c", "latex": ".tex", "sympy": "_sympy.py"}


def symbolic_models(
    robot: Robot,
    what: Sequence[str] | None = None,
    columns: Columns = "base",
    values: np.ndarray | None = None,
) -> list[Program]:
    """Programs of a robot.

    Args:
        robot: the robot.
        what: names out of ``MODELS``, and ``LOOP_MODELS`` of a robot with closed loops; None: all
            that it has.
        columns: parameters of the models (base, standard or chosen ones).
        values: their values, shape (parameters,), folded into the programs; None: they are
            arguments.

    Returns:
        A program for each name. Parameter values are no part of ``regressor`` and ``base``.

    Raises:
        RobotDescriptionError: ``LOOP_MODELS`` of a tree; friction that closed loops do not handle.
    """
    if columns == "base":
        columns = base_parameters(robot)  # computed once for all of them
    makers: Mapping[str, Callable[[], Program]] = {
        "inverse": lambda: inverse_model(robot, columns, values),
        "regressor": lambda: observation_matrix(robot, columns),
        "mass": lambda: mass_matrix(robot, columns, values),
        "gravity": lambda: gravity_vector(robot, columns, values),
        "coriolis": lambda: coriolis_vector(robot, columns, values),
        "base": lambda: base_parameter_program(robot),
        "closure": lambda: closure_equations(robot),
        "motion": lambda: joint_motion(robot),
    }
    return [makers[name]() for name in (models_of(robot) if what is None else what)]


def models_of(robot: Robot) -> list[str]:
    """Names of all models that there are of a robot."""
    return [*MODELS, *(LOOP_MODELS if robot.constraints is not None else ())]


def base_parameter_program(robot: Robot, groups: ClosedFormBaseParameters | None = None) -> Program:
    """Base parameters theta from standard parameters, as a program.

    By the closed form; with closed loops, where groups reach over the loops, and on a measured base
    from the observation matrix (`pivident.dynamics.base_parameters`).
    """
    found: ClosedFormBaseParameters | BaseParameters
    if has_closed_form(robot):
        found = closed = groups or closed_form_base_parameters(robot, "numbers")
        elements = list(closed.expressions.values())
    else:
        found = base_parameters(robot)
        elements = list(group_expressions(found))
    symbols = tuple(symbol(p.name) for p in found.standard)
    given = "standard parameters, " + " ".join(p.name for p in found.standard)
    return Program.build(
        "base_parameters",
        [Input("standard", symbols, given)],
        Input("theta", (), ""),
        [Output("base", output_array(elements), "base parameters, " + " ".join(found.names))],
        title=f"Base parameters of {robot.name}",
    )


def has_closed_form(robot: Robot) -> bool:
    """Whether rules find the groups of its base parameters: of a tree on a fixed base."""
    return robot.constraints is None and not robot.base_joints


def group_expressions(base: BaseParameters) -> Iterator[Expression]:
    """Base parameters θ_k + K θ_d as expressions in standard ones, K as numbers."""
    for head, row in zip(base.parameters, base.regrouping.tolist(), strict=True):
        total: Expression = symbol(head.name)
        for k, factor in zip(base.dropped, row, strict=True):
            total = total + factor * symbol(base.standard[k].name)
        yield total


def nominal_standard_values(robot: Robot) -> np.ndarray:
    """Standard parameters of the nominal (CAD) values in a robot's description."""
    nominal = nominal_values(robot, standard_parameters(robot))
    if not nominal.any():
        raise RobotDescriptionError(
            f"robot {robot.name!r} has no nominal parameter values",
            advice="leave out --values and give the parameters to the generated functions",
        )
    return nominal


def model_files(
    robot: Robot, programs: Sequence[Program], languages: Sequence[str]
) -> dict[str, str]:
    """Texts of files by name; the robot gives files their name and C functions their prefix."""
    stem = identifier(robot.name).lower()
    printers: Mapping[str, Callable[[Sequence[Program]], str]] = {
        "python": python_module,
        "c": partial(c_source, prefix=f"{stem}_"),
        "latex": latex_document,
        "sympy": sympy_module,
    }
    files = {f"{stem}{LANGUAGES[name]}": printers[name](programs) for name in languages}
    if "c" in languages:
        files[f"{stem}.h"] = c_header(programs, prefix=f"{stem}_")
    return files
