"""Torques of single joints: rotor inertias, friction, springs, motor couplings."""

from __future__ import annotations

import math

from pivident.dynamics.entry_plan import coupling_sign
from pivident.dynamics.grouping.expressions import (
    ONE,
    Expression,
    call,
    cosine,
    divide,
    power,
    sine,
)
from pivident.dynamics.parameters import Parameter
from pivident.robot.friction import FrictionColumn, FrictionTerm
from pivident.robot.friction_term import SignFunction
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
    if code == SignFunction.SIGN:
        return call("sign", dq)
    if code == SignFunction.ATAN:
        return (2.0 / math.pi) * call("atan", gamma * dq)
    return call("tanh", gamma * dq)


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
    c = FrictionColumn
    column, code, shape = term.encoded()
    if term.has_memory:
        assert inner is not None
        return inner
    if column in (c.VISCOUS, c.VISCOUS_POSITIVE, c.VISCOUS_NEGATIVE, c.OFFSET):
        functions = {
            c.VISCOUS: lambda: dq,
            c.OFFSET: lambda: ONE,
            c.VISCOUS_POSITIVE: lambda: call("maximum", dq, 0.0),
            c.VISCOUS_NEGATIVE: lambda: call("minimum", dq, 0.0),
        }
        return functions[c(column)]()
    if term.depends_on_position:
        return _position_column(c(column), shape, q)
    if column == c.POWER:
        smooth = smooth_sign(code if shape[1] < 1.0 else SignFunction.SIGN, shape[0], dq)
        return smooth * power(call("abs", dq), shape[1])
    s = smooth_sign(code, shape[0], dq)
    if column == c.COULOMB:
        return s
    if column == c.COULOMB_POSITIVE:
        return 0.5 * (1.0 + s)
    if column == c.COULOMB_NEGATIVE:
        return -0.5 * (1.0 - s)
    if column == c.LOAD:
        assert inner is not None
        return call("abs", inner) * s
    ratio = dq * (1.0 / shape[1])
    squared = ratio * ratio if shape[2] == 2.0 else power(call("abs", ratio), shape[2])
    return s * call("exp", -squared)


def _position_column(column: FrictionColumn, shape: tuple[float, ...], q: Expression) -> Expression:
    """Ripple cos(n q), sin(n q), spring q, strut; see ``pivident.robot.friction``."""
    if column is FrictionColumn.SPRING:
        return q
    if column is FrictionColumn.COSINE:
        return cosine(shape[1] * q)
    if column is FrictionColumn.SINE:
        return sine(shape[1] * q)
    ratio, angle = shape[1], q - shape[2]
    if column is FrictionColumn.STRUT_STIFFNESS:
        return sine(angle)
    squared = (1.0 + ratio**2) - 2.0 * ratio * cosine(angle)
    return divide(sine(angle), call("sqrt", squared))
