"""The symbols of a robot's model: positions, speeds, accelerations, parameters."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from pivident.dynamics.base_parameters import BaseParameters, base_parameters
from pivident.dynamics.grouping.expression_graph import symbol
from pivident.dynamics.grouping.expressions import ZERO, Expression, constant
from pivident.dynamics.parameters import Parameter, standard_parameters
from pivident.errors import RobotDescriptionError
from pivident.robot.description import INERTIAL, Robot, without_loops
from pivident.symbolic.assignments import Input
from pivident.symbolic.vectors import Tensor, Vector

#: Which columns of the model: base or standard parameters, or chosen ones.
Columns = Literal["base", "standard"] | BaseParameters | Sequence[Parameter]


@dataclass(frozen=True)
class LinkInertia:
    """The ten inertial parameters of a link."""

    tensor: Tensor  # inertia at the frame's origin
    moments: Vector  # first moments
    mass: Expression


@dataclass(frozen=True, eq=False)
class ModelSymbols:
    """A robot whose motion and parameters are symbols."""

    robot: Robot
    parameters: tuple[Parameter, ...]  # columns of the model, in order
    theta: tuple[Expression, ...]  # value of each: its symbol, or a number
    q: tuple[Expression, ...]
    dq: tuple[Expression, ...]
    ddq: tuple[Expression, ...]
    gravity: Vector  # in the base frame
    argument: Input  # θ as an argument of a program; no symbols for numbers

    def value(self, stem: str, joint: int) -> Expression:
        """A link's parameter; zero if it is no column."""
        for p, value in zip(self.parameters, self.theta, strict=True):
            if p.stem == stem and p.joint == joint:
                return value
        return ZERO

    def inertias(self) -> list[LinkInertia]:
        """Ten parameters of each link."""
        values = [{stem: ZERO for stem in INERTIAL} for _ in self.robot.joints]
        for p, value in zip(self.parameters, self.theta, strict=True):
            if p.is_inertial:
                values[p.joint][p.stem] = value
        return [
            LinkInertia(
                Tensor(*(v[stem] for stem in INERTIAL[:6])), (v["mx"], v["my"], v["mz"]), v["m"]
            )
            for v in values
        ]

    def inputs(self, *names: str) -> tuple[Input, ...]:
        """Arguments of a program out of ``q dq ddq``."""
        meaning = {"q": "joint positions", "dq": "joint speeds", "ddq": "joint accelerations"}
        units = {"q": "", "dq": "/s", "ddq": "/s^2"}
        return tuple(
            Input(
                name,
                tuple(symbol(f"{name}{i + 1}") for i in range(self.robot.size)),
                f"{meaning[name]} [{_units(self.robot, units[name])}]",
            )
            for name in names
        )


def model_symbols(
    robot: Robot, columns: Columns = "base", values: np.ndarray | None = None
) -> ModelSymbols:
    """Symbols for the motion and the parameters of a robot; other parameters are zero."""
    without_loops(robot, "the writer of symbolic models")
    if isinstance(columns, str):
        columns = base_parameters(robot) if columns == "base" else standard_parameters(robot)
    if isinstance(columns, BaseParameters):
        parameters, names = columns.parameters, columns.names
    else:
        parameters, names = tuple(columns), tuple(p.name for p in columns)
    symbols = tuple(symbol(name) for name in names)
    theta: tuple[Expression, ...] = symbols
    argument = Input("theta", symbols, "parameters, " + " ".join(names))
    if values is not None:
        numbers = np.asarray(values, dtype=float)
        if numbers.shape != (len(parameters),):
            raise RobotDescriptionError(
                f"the values of the parameters have shape {numbers.shape}; give {len(parameters)} "
                f"numbers, one for each of {', '.join(names[:3])} …"
            )
        theta = tuple(constant(x) for x in numbers.tolist())
        argument = Input("theta", (), "")
    n = robot.size
    g = tuple(constant(x) for x in robot.gravity.tolist())
    return ModelSymbols(
        robot,
        parameters,
        theta,
        tuple(symbol(f"q{i + 1}") for i in range(n)),
        tuple(symbol(f"dq{i + 1}") for i in range(n)),
        tuple(symbol(f"ddq{i + 1}") for i in range(n)),
        (g[0], g[1], g[2]),
        argument,
    )


def _units(robot: Robot, suffix: str) -> str:
    kinds = {joint.kind for joint in robot.joints}
    names = [unit for kind, unit in (("revolute", "rad"), ("prismatic", "m")) if kind in kinds]
    return " or ".join(f"{name}{suffix}" for name in names)
