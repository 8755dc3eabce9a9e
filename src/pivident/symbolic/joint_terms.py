"""Torques of single joints: rotor inertias, friction, springs, motor couplings."""

from __future__ import annotations

import math
from functools import partial

from pivident.dynamics.entry_plan import coupling_sign
from pivident.dynamics.grouping.expressions import (
    Expression,
    as_expression,
    call,
    cosine,
    power,
    sine,
)
from pivident.dynamics.parameters import Parameter
from pivident.robot.friction_column import SIGNS, evaluated
from pivident.robot.friction_term import FrictionTerm
from pivident.symbolic.model_symbols import ModelSymbols


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
        factor = c.ratio if joint == c.joint else 1.0
        return factor * smooth_sign(code, gamma, speed)
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
    _, code, shape = term.encoded()
    names = {"q": q, "dq": dq, "s": smooth_sign(code, shape[0], dq), "load": inner}
    return as_expression(term.column.evaluate(term.values, {**_FUNCTIONS, **names}))


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
