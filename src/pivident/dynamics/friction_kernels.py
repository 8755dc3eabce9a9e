"""Friction of single joints in the simulator: values, slopes and stiffnesses, scalars.

In a step that starts at the position q₀ with the states z₀, friction is a function of the speed v
and of the travel x in the step: F(x, v). Terms of speed alone have the slope D = ∂F/∂v; ripple and
presliding also have a stiffness K = ∂F/∂x. The state is not an unknown of its own, because for
travel in one direction it is an explicit function of the travel:

    presliding    dz/dx = (1 - s z/g)/d, with g(x) linear in the travel:
                  z = s g₁ + (z₀ - s g₀) exp(-u) - s (g₁ - g₀) (1 - exp(-u))/u,   u = |x|/(d ḡ)
    Maxwell slip  z = min(max(z₀ + x/d, -g₁), g₁)

with s = sign(x), g₀ and g₁ the levels at both ends and ḡ their mean. Travel with a reversal is
split there; travel on which g changes much is cut into pieces, with v² linear in the travel. The
codes are those of ``pivident.robot.friction``.

Columns of friction that other distributions declare, called by their address.

Kernels that are kept compiled cannot name functions that they do not know. So what a kernel is
given as the code of such a column is the address of its compiled function, which any kernel can
call; addresses are larger than any code.
"""

from __future__ import annotations

import math
from typing import Any

from llvmlite import ir
from numba import cfunc, types
from numba.extending import intrinsic

from pivident.dynamics.elementary import REST, arctangent, direction
from pivident.dynamics.friction_generated import position_derivatives, speed_derivatives
from pivident.foundation.compiled import inlined as _inline, kernel, shared
from pivident.robot.friction_column import SignFunction
from pivident.robot.friction_terms.presliding import PRESLIDING

_PRESLIDING = int(PRESLIDING)
_ATAN, _TANH = int(SignFunction.ATAN), int(SignFunction.TANH)
_SHARP = int(SignFunction.SHARP)
_OF_POSITION = int(SignFunction.NONE)

#: Exponents beyond which exp(-x) is negligible beside 1.
_NOTHING = 40.0

#: Change of the level g above which travel is cut into pieces …
LEVEL_PER_PIECE = 0.02

#: … and the maximum number of pieces.
MAX_PIECES = 32


@_inline
def sign_partials(sign, gamma, v):
    """s, ∂s/∂v, ∂²s/∂v², ∂s/∂γ and ∂²s/∂v∂γ of a sign; what is not used is not computed.

    The hard sign is not simulated, but where a factor |v|^p makes it continuous: its slope at rest
    is that of a step over a tiny speed.
    """
    x = gamma * v
    if sign == _ATAN:
        c, r = 2.0 / math.pi, 1.0 / (1.0 + x * x)
        return (
            c * arctangent(x),
            c * gamma / (1.0 + x * x),
            -2.0 * c * gamma * gamma * x * r * r,
            c * v * r,
            c * r * r * (1.0 - x * x),
        )
    if sign == _TANH:
        s = math.tanh(x)
        e = 1.0 - s * s
        return s, gamma * e, -2.0 * gamma * gamma * s * e, v * e, e - 2.0 * x * s * e
    step = 1.0 / REST if v == 0.0 and sign == _SHARP else 0.0
    return direction(v), step, 0.0, 0.0, 0.0


@shared
def smooth_sign_and_slope(sign, gamma, v):
    """Smoothed sign at one speed and its slope there."""
    partials = sign_partials(sign, gamma, v)
    return partials[0], partials[1]


@shared
def friction_value_and_slope(column, sign, gamma, first, second, v):
    """f(v) of one term of speed and df/dv; ``first second``: its constants, such as v_s and δ."""
    s, slope = smooth_sign_and_slope(sign, gamma, v)
    if column >= FIRST_ADDRESS:
        return (
            call_column(column, VALUE, s, slope, 0.0, 0.0, 0.0, first, second, v),
            call_column(column, SLOPE, s, slope, 0.0, 0.0, 0.0, first, second, v),
        )
    found = speed_derivatives(column, s, slope, 0.0, 0.0, 0.0, first, second, v)
    return found[VALUE], found[SLOPE]


@shared
def position_value_and_slope(column, first, second, q):
    """f(q) of one term of position and df/dq."""
    if column >= FIRST_ADDRESS:
        return (
            call_column(column, VALUE, 0.0, 0.0, 0.0, 0.0, 0.0, first, second, q),
            call_column(column, SLOPE, 0.0, 0.0, 0.0, 0.0, 0.0, first, second, q),
        )
    found = position_derivatives(column, first, second, q)
    return found[VALUE], found[SLOPE]


@shared
def level_and_slope(excess, inverse_speed, exponent, v):
    """Level g = 1 + ρ exp(-|v/v_s|^δ) of friction with a state, and dg/dv."""
    if excess == 0.0 or v == 0.0:
        return 1.0 + excess, 0.0
    ratio = abs(v) * inverse_speed
    power = ratio * ratio if exponent == 2.0 else ratio**exponent
    if power > _NOTHING:
        return 1.0, 0.0
    fall = excess * math.exp(-power)
    return 1.0 + fall, -exponent * power * fall / v


@_inline
def travel_to_reversal(v_start, v, elapsed):
    """Travel until the reversal, the speed changing linearly from ``v_start`` to ``v``."""
    return 0.5 * v_start * v_start * elapsed / (v_start - v)


@_inline
def presliding_state(z, level, level_ahead, x, inverse_distance):
    """State z after the travel ``x``, the level changing from ``level`` to ``level_ahead``."""
    s = math.copysign(1.0, x)
    u = 2.0 * abs(x) * inverse_distance / (level + level_ahead)
    if u < 1e-3:  # (1 - exp(-u))/u, free of cancellation
        mean_decay = 1.0 - 0.5 * u * (1.0 - u / 3.0 * (1.0 - 0.25 * u))
        decay = 1.0 - u * mean_decay
    else:
        decay = math.exp(-u) if u < _NOTHING else 0.0
        mean_decay = (1.0 - decay) / u
    return s * level_ahead + (z - s * level) * decay - s * (level_ahead - level) * mean_decay


@_inline
def presliding_stiffness(z, level, v, inverse_distance):
    """dz/dx = (1 - s z/g)/d at the speed ``v``, s = sign(v); 1/d at rest."""
    if v == 0.0:
        return inverse_distance
    return (1.0 - math.copysign(z, z * v) / level) * inverse_distance


@_inline
def slip_state(z, level, x, inverse_distance):
    """State of a Maxwell element after the travel ``x``."""
    return min(max(z + x * inverse_distance, -level), level)


@_inline
def slip_stiffness(z, level, v, inverse_distance):
    """dz/dx of a Maxwell element at the speed ``v``: zero where it slips."""
    return 0.0 if abs(z) >= level and z * v > 0.0 else inverse_distance


@_inline
def state_after_way(
    column, z, v_start, start_level, v, level, x,
    inverse_distance, excess, inverse_speed, exponent,
):  # fmt: skip
    """State after the travel x in one direction, from speed and level g at its start to its end."""
    pieces = 1
    if abs(level - start_level) > LEVEL_PER_PIECE:
        pieces = min(math.ceil(abs(level - start_level) / LEVEL_PER_PIECE), MAX_PIECES)
    part, square, last = x / pieces, v_start * v_start, start_level
    for i in range(1, pieces + 1):
        here = level
        if i < pieces:
            speed = math.sqrt(square + i / pieces * (v * v - square))
            here, _ = level_and_slope(excess, inverse_speed, exponent, speed)
        if column == _PRESLIDING:
            z = presliding_state(z, last, here, part, inverse_distance)
        else:
            z = slip_state(z, here, part, inverse_distance)
        last = here
    return z


#: Codes below are those of pivident.
FIRST_ADDRESS = 1000

#: What functions of columns count: value, slope by the quantity, curvature, and for γ and two
#: constants of shape the derivatives of value and slope by it.
VALUE, SLOPE, CURVATURE, BY_GAMMA = 0, 1, 2, 3
COUNT = 9

#: What those of position, speed and load count in their place, after value and slope by speed.
BY_POSITION, BY_LOAD = 3, 4

#: Numbers that it is given: s, ∂s/∂v, ∂²s/∂v², ∂s/∂γ and ∂²s/∂v∂γ, two constants and its quantity;
#: of several quantities speed, load and position in the place of these.
NUMBERS = 8

#: Type of such a function.
ADDRESS_SIGNATURE = types.float64(types.int64, *[types.float64] * NUMBERS)

#: Decorator of a column's function.
column_function = cfunc(ADDRESS_SIGNATURE, cache=True, error_model="numpy")


def _call_column(context, address, which, s, s_v, s_vv, s_g, s_vg, first, second, x):
    """Call the function of a column at an address."""

    def called(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        double = ir.DoubleType()
        kind = ir.FunctionType(double, [ir.IntType(64), *[double] * NUMBERS])
        return builder.call(builder.inttoptr(arguments[0], kind.as_pointer()), arguments[1:])

    wanted = (types.int64, types.int64, *[types.float64] * NUMBERS)
    return types.float64(*wanted), called


#: The value of a column's function at an address, in compiled code.
call_column: Any = intrinsic(_call_column)


@_inline
def motion_value(column, which, sign, gamma, v, load, q):
    """What ``which`` counts, of a column of several quantities, whose code is minus its address."""
    s, slope = smooth_sign_and_slope(sign, gamma, v)
    return call_column(-column, which, s, slope, 0.0, 0.0, 0.0, v, load, q)


@_inline
def motion_values(column, sign, gamma, v, q):
    """Value of such a column without load, and its slopes by position and by speed."""
    return (
        motion_value(column, VALUE, sign, gamma, v, 0.0, q),
        motion_value(column, BY_POSITION, sign, gamma, v, 0.0, q),
        motion_value(column, SLOPE, sign, gamma, v, 0.0, q),
    )


@kernel
def values_at_states(column, which, sign, gamma, v, load, q, out):
    """What ``which`` counts, of a column that has an address, at many states, shape (states,)."""
    for k in range(out.size):
        if column < 0:
            out[k] = motion_value(column, which, sign, gamma, v[k], load[k], q[k])
        else:
            s, slope = smooth_sign_and_slope(sign, gamma, v[k])
            x = q[k] if sign <= _OF_POSITION else v[k]
            out[k] = call_column(column, which, s, slope, 0.0, 0.0, 0.0, 0.0, 0.0, x)
