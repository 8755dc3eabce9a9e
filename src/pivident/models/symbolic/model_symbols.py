"""The symbols of a robot's model, and the torques of single joints in them.

Torques of single joints: rotor inertias, friction, springs, motor couplings.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Literal

import numpy as np

from pivident.dynamics.base_parameters import BaseParameters, base_parameters
from pivident.dynamics.entry_plan import coupling_sign
from pivident.dynamics.grouping.expression_graph import symbol
from pivident.dynamics.grouping.expressions import (
    ZERO,
    Expression,
    as_expression,
    call,
    constant,
    cosine,
    foreign_call,
    power,
    sine,
)
from pivident.dynamics.parameters import Parameter, standard_parameters
from pivident.foundation.errors import ExportError, RobotDescriptionError
from pivident.models.symbolic.assignments import Input, LoopClosing
from pivident.models.symbolic.sums import Tensor, Vector
from pivident.robot.description import INERTIAL, Robot
from pivident.robot.friction_column import SIGNS, FrictionColumn, evaluated
from pivident.robot.friction_term import FrictionTerm

#: Which columns of the model: base or standard parameters, or chosen ones.
Columns = Literal["base", "standard"] | BaseParameters | Sequence[Parameter]
#: The parameters of a program that has none.
NOTHING = Input("theta", (), "")


@dataclass(frozen=True)
class LinkInertia:
    """The ten inertial parameters of a link."""

    tensor: Tensor  # inertia at the frame's origin
    moments: Vector  # first moments
    mass: Expression


@dataclass(frozen=True, eq=False)
class ModelSymbols:
    """A robot whose motion and parameters are symbols.

    Of a mechanism with closed loops it is the tree of all joints: the motion of dependent joints
    are expressions in that of the independent ones, see `closed_symbols`.
    """

    robot: Robot  # a tree
    q: tuple[Expression, ...]
    dq: tuple[Expression, ...]
    ddq: tuple[Expression, ...]
    drift: tuple[Expression, ...]  # ddq where independent joints are not accelerated
    gravity: Vector  # in the base frame
    places: tuple[int, ...]  # joints whose motion is given
    gain: np.ndarray | None = None  # N of closed loops, shape (joints, places)
    closing: LoopClosing | None = None  # what finds positions without closed form
    hints: tuple[tuple[str, Expression], ...] = ()  # names of what depends on closed loops
    parameters: tuple[Parameter, ...] = ()  # columns of the model, in order
    theta: tuple[Expression, ...] = ()  # value of each: its symbol, or a number
    argument: Input = NOTHING  # θ as an argument of a program; empty for numbers

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
        return tuple(motion_input(self.robot, name, self.places) for name in names)


def bare_symbols(tree: Robot) -> ModelSymbols:
    """A tree whose joints all move by symbols of their own, without parameters."""
    q, dq, ddq = (
        tuple(symbol(f"{name}{i + 1}") for i in range(tree.size)) for name in ("q", "dq", "ddq")
    )
    g = tuple(constant(x) for x in tree.gravity.tolist())
    still = (ZERO,) * tree.size
    return ModelSymbols(tree, q, dq, ddq, still, (g[0], g[1], g[2]), tuple(range(tree.size)))


def with_parameters(
    model: ModelSymbols, robot: Robot, columns: Columns = "base", values: np.ndarray | None = None
) -> ModelSymbols:
    """The same with parameters of its robot; those that are no columns are zero."""
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
                f"the values of the parameters have shape {numbers.shape}",
                advice=f"give {len(parameters)} numbers, one for each of {', '.join(names[:3])} …",
            )
        theta = tuple(constant(x) for x in numbers.tolist())
        argument = NOTHING
    return replace(model, parameters=parameters, theta=theta, argument=argument)


def motion_input(tree: Robot, name: str, places: Sequence[int]) -> Input:
    """Positions, speeds or accelerations (``q dq ddq``) of some joints as an argument."""
    meaning = {"q": "joint positions", "dq": "joint speeds", "ddq": "joint accelerations"}
    units = {"q": "", "dq": "/s", "ddq": "/s^2"}
    text = f"{meaning[name]} [{_units(tree, places, units[name])}]"
    if len(places) < tree.size:
        text += " of " + ", ".join(f"{tree.joints[i].name} ({i + 1})" for i in places)
    return Input(name, tuple(symbol(f"{name}{i + 1}") for i in places), text)


def _units(robot: Robot, places: Sequence[int], suffix: str) -> str:
    kinds = {robot.joints[i].kind for i in places}
    names = [unit for kind, unit in (("revolute", "rad"), ("prismatic", "m")) if kind in kinds]
    return " or ".join(f"{name}{suffix}" for name in names)


def joints_of(p: Parameter) -> tuple[int, ...]:
    """Joints on which a parameter acts that is not one of a link's ten."""
    return (p.joint,) if p.coupling is None else (p.coupling.joint, p.coupling.motor)


def joint_column(
    model: ModelSymbols, p: Parameter, joint: int, inner: Expression | None = None
) -> Expression:
    """Entry of the observation matrix for a parameter that is not one of a link's ten.

    ``inner`` is the column itself of friction with memory; the load of load-dependent friction.
    """
    if p.friction is not None:
        return _friction_column(p.friction, model.q[joint], model.dq[joint], inner)
    if p.coupling is None:
        return model.ddq[joint]
    c = p.coupling
    if p.stem == "fcm":
        speed = model.dq[c.motor] + c.ratio * model.dq[c.joint]
        code, gamma = coupling_sign(model.robot, c.motor)
        return (c.ratio if joint == c.joint else 1.0) * smooth_sign(code, gamma, speed)
    other = c.motor if joint == c.joint else c.joint
    return c.ratio * (model.ddq[other] if p.stem == "iam" else model.dq[other])


def smooth_sign(code: int, gamma: float, dq: Expression) -> Expression:
    """sign(dq), (2/π) atan(γ dq) or tanh(γ dq)."""
    names = {"gamma": gamma, "dq": dq}
    return as_expression(evaluated(SIGNS[code], {**_FUNCTIONS, **names}))


def has_memory(p: Parameter) -> bool:
    """Whether it belongs to friction with memory."""
    return p.friction is not None and p.friction.has_memory


def depends_on_load(p: Parameter) -> bool:
    """Whether it belongs to friction that grows with the load."""
    return p.friction is not None and p.friction.depends_on_load


def inner_name(p: Parameter) -> str:
    """Name of the signal for the path or the load of a friction term."""
    return f"z_{p.name}" if has_memory(p) else f"load_{p.name}"


def _friction_column(
    term: FrictionTerm, q: Expression, dq: Expression, inner: Expression | None
) -> Expression:
    if term.has_memory:
        assert inner is not None
        return inner
    if not term.column.expression:
        return _c_call(term.column, {"q": q, "dq": dq, "load": inner})
    _, code, shape = term.encoded()
    names = {"q": q, "dq": dq, "s": smooth_sign(code, shape[0], dq), "load": inner}
    return as_expression(term.column.evaluate(term.values, {**_FUNCTIONS, **names}))


def _c_call(column: FrictionColumn, motion: Mapping[str, Expression | None]) -> Expression:
    """A call of the function in C that stands for a compiled one."""
    if not column.c_source:
        raise ExportError(
            f"the friction {column.name!r} is a compiled function, of which there is no formula",
            advice="declare it by an expression, or with its c_source for files in C; JSON and "
            "files of simulators need neither",
        )
    return foreign_call(column.name, *(motion[name] or ZERO for name in column.arguments))


#: Names in the expressions that friction terms declare.
_FUNCTIONS = {
    "sin": sine,
    "cos": cosine,
    "abs": partial(call, "abs"),
    "power": power,
    "exp": partial(call, "exp"),
    "sqrt": partial(call, "sqrt"),
    "max": partial(call, "maximum"),
    "min": partial(call, "minimum"),
    "sign": partial(call, "sign"),
    "atan": partial(call, "atan"),
    "tanh": partial(call, "tanh"),
    "pi": math.pi,
}
