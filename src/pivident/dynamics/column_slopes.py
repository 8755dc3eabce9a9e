"""Slopes of columns that depend on the motion of one joint or two: rotor, friction, coupling.

Second derivatives of friction of speed: by the speed, and by the constants of its shape.

The simulator integrates friction f(v; p) with its slope ∂f/∂v, so a tangent of the simulation needs
∂²f/∂v², and along a constant p (γ, v_s and δ of Stribeck friction, the exponent of a power) both
∂f/∂p and ∂²f/∂v∂p.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from pivident.dynamics.entry_plan import coupling_sign, has_inner_signal
from pivident.dynamics.friction import column_values
from pivident.dynamics.friction_generated import position_derivatives, speed_derivatives
from pivident.dynamics.friction_kernels import (
    BY_GAMMA,
    BY_POSITION,
    CURVATURE,
    FIRST_ADDRESS,
    SLOPE,
    call_column,
    friction_value_and_slope,
    position_value_and_slope,
    sign_partials,
)
from pivident.dynamics.friction_table import OF_POSITION
from pivident.dynamics.parameters import Parameter
from pivident.dynamics.regressor import Regressor
from pivident.foundation.compiled import inlined as _inline, inner, kernel
from pivident.robot.description import Robot
from pivident.robot.friction_term import FrictionTerm
from pivident.robot.friction_terms.coulomb import COULOMB
from pivident.robot.friction_terms.offset import OFFSET

#: A slope from the joint's position and speed, and the speed of the other joint.
Slope = Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]


@dataclass(frozen=True, eq=False)
class ColumnSlope:
    """How a column changes with the motion of a joint."""

    joint: int  # row of the observation matrix
    column: int  # parameter
    motion_of: int  # joint on whose motion it depends
    quantity: int  # 0 position, 1 speed, 2 acceleration
    value: Slope
    other: int  # a second joint that it depends on; the first one where there is none
    ratio: float = 0.0  # its share: the slope by the second joint over that by the first


def column_slopes(regressor: Regressor) -> tuple[ColumnSlope, ...]:
    """Slopes of all columns without inertial parameter that have one."""
    found = []
    for j, c in zip(regressor.row.tolist(), regressor.column.tolist(), strict=True):
        p = regressor.parameters[c]
        if not p.is_inertial and not has_inner_signal(p):
            found += _slopes_of(regressor.robot, p, j, c)
    return tuple(found)


def _slopes_of(robot: Robot, p: Parameter, joint: int, column: int) -> list[ColumnSlope]:
    """Slopes of one entry: one, none of a constant, two of a function of position and speed."""
    if p.friction is None:
        return [_slope(robot, p, joint, column)]
    return [
        ColumnSlope(joint, column, joint, quantity, value, joint)
        for quantity, value in _friction_slopes(p.friction)
    ]


def _slope(robot: Robot, p: Parameter, joint: int, column: int) -> ColumnSlope:
    """Slope of one entry of a rotor or a coupling."""
    if p.coupling is None:  # a rotor
        return ColumnSlope(joint, column, joint, 2, _constant(1.0), joint)
    c = p.coupling
    if p.stem == "fcm":
        sign, gamma = coupling_sign(robot, c.motor)
        factor = c.ratio if joint == c.joint else 1.0

        def coulomb(q: np.ndarray, dq: np.ndarray, other: np.ndarray) -> np.ndarray:
            shape = (gamma, 0.0, 0.0)
            return factor * _slopes_at(int(COULOMB), sign, shape, dq + c.ratio * other)

        return ColumnSlope(joint, column, c.motor, 1, coulomb, c.joint, c.ratio)
    moved = c.motor if joint == c.joint else c.joint
    quantity = 2 if p.stem == "iam" else 1
    return ColumnSlope(joint, column, moved, quantity, _constant(c.ratio), moved)


def _constant(value: float) -> Slope:
    return lambda q, dq, other: np.full(q.shape, value)


def _friction_slopes(term: FrictionTerm) -> list[tuple[int, Slope]]:
    """Quantities that a friction column depends on, with its slopes; see ``dynamics.friction``."""
    column, sign, shape = term.encoded()
    if column == OFFSET.code:
        return []
    if term.column.of_motion:

        def along(which: int) -> Slope:
            return lambda q, dq, other: column_values(term, which, q, dq)

        return [(0, along(BY_POSITION)), (1, along(SLOPE))]
    quantity = 0 if term.depends_on_position else 1
    return [(quantity, lambda *motion: _slopes_at(column, sign, shape, motion[quantity]))]


def _slopes_at(column: int, sign: int, shape: tuple[float, ...], x: np.ndarray) -> np.ndarray:
    """Slope of a column by its quantity, at values of it."""
    slopes = np.empty(x.size)
    _slopes(column, sign, *shape[:3], np.ascontiguousarray(x).ravel(), slopes)
    return slopes.reshape(x.shape)


@kernel
def _slopes(column, sign, gamma, first, second, x, slopes):
    for k in range(x.size):
        if sign <= OF_POSITION:
            _, slopes[k] = position_value_and_slope(column, first, second, x[k])
        else:
            _, slopes[k] = friction_value_and_slope(column, sign, gamma, first, second, x[k])


_COULOMB = int(COULOMB)

#: Column of ``FrictionTable.term_value`` that holds γ.
_GAMMA = 1


@inner
def speed_partials(column, sign, gamma, first, second, v, which):
    """∂²f/∂v², ∂f/∂p and ∂²f/∂v∂p of one nonlinear term of speed for the constant ``which``.

    ``first second``: v_s and δ; ``which``: a column of ``term_value`` after the parameter: γ, v_s
    or δ.
    """
    s, s_v, s_vv, s_g, s_vg = sign_partials(sign, gamma, v)
    at = BY_GAMMA + 2 * (which - _GAMMA)
    if column >= FIRST_ADDRESS:
        return (
            call_column(column, CURVATURE, s, s_v, s_vv, s_g, s_vg, first, second, v),
            call_column(column, at, s, s_v, s_vv, s_g, s_vg, first, second, v),
            call_column(column, at + 1, s, s_v, s_vv, s_g, s_vg, first, second, v),
        )
    found = speed_derivatives(column, s, s_v, s_vv, s_g, s_vg, first, second, v)
    return found[CURVATURE], found[at], found[at + 1]


@inner
def position_partials(column, first, second, q, which):
    """∂²f/∂q², ∂f/∂p and ∂²f/∂q∂p of one term of position for the constant ``which``."""
    at = BY_GAMMA + 2 * (which - _GAMMA)
    if column >= FIRST_ADDRESS:
        return (
            call_column(column, CURVATURE, 0.0, 0.0, 0.0, 0.0, 0.0, first, second, q),
            call_column(column, at, 0.0, 0.0, 0.0, 0.0, 0.0, first, second, q),
            call_column(column, at + 1, 0.0, 0.0, 0.0, 0.0, 0.0, first, second, q),
        )
    found = position_derivatives(column, first, second, q)
    return found[CURVATURE], found[at], found[at + 1]


@_inline
def speed_curvature(column, sign, gamma, first, second, v):
    """∂²f/∂v² of one nonlinear term of speed, see ``speed_partials``."""
    if column == _COULOMB:
        return sign_partials(sign, gamma, v)[2]
    return speed_partials(column, sign, gamma, first, second, v, _GAMMA)[0]
