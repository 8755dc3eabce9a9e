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
"""

from __future__ import annotations

import math

from pivident.compiled import inlined as _inline
from pivident.compiled import shared
from pivident.dynamics.elementary import arctangent
from pivident.robot.friction import FrictionColumn
from pivident.robot.friction_term import SignFunction

_COULOMB = int(FrictionColumn.COULOMB)
_POSITIVE = int(FrictionColumn.COULOMB_POSITIVE)
_NEGATIVE = int(FrictionColumn.COULOMB_NEGATIVE)
_STRIBECK = int(FrictionColumn.STRIBECK)
_POWER = int(FrictionColumn.POWER)
_FORWARDS = int(FrictionColumn.VISCOUS_POSITIVE)
_PRESLIDING = int(FrictionColumn.PRESLIDING)
_ATAN = int(SignFunction.ATAN)

#: Exponents beyond which exp(-x) is negligible beside 1.
_NOTHING = 40.0

#: Change of the level g above which travel is cut into pieces …
LEVEL_PER_PIECE = 0.02

#: … and the maximum number of pieces.
MAX_PIECES = 32


@shared
def smooth_sign_and_slope(sign, gamma, v):
    """Smoothed sign at one speed and its slope there (the hard sign is not simulated)."""
    x = gamma * v
    if sign == _ATAN:
        return 2.0 / math.pi * arctangent(x), 2.0 / math.pi * gamma / (1.0 + x * x)
    s = math.tanh(x)
    return s, gamma * (1.0 - s * s)


@shared
def friction_value_and_slope(column, sign, gamma, first, second, v):
    """f(v) of one nonlinear term of speed and df/dv; v_s and δ, or p, are ``first second``."""
    s, slope = smooth_sign_and_slope(sign, gamma, v)
    if column == _COULOMB:
        return s, slope
    if column == _POSITIVE:
        return 0.5 * (1.0 + s), 0.5 * slope
    if column == _NEGATIVE:
        return -0.5 * (1.0 - s), 0.5 * slope
    if column == _STRIBECK:
        ratio = abs(v / first) ** second
        fall = math.exp(-ratio)
        decline = 0.0 if v == 0.0 else -s * fall * second * ratio / v
        return s * fall, slope * fall + decline
    if column == _POWER:
        return _power_and_slope(s, slope, first, v)
    moving = v > 0.0 if column == _FORWARDS else v < 0.0
    return (v, 1.0) if moving else (0.0, 0.5 if v == 0.0 else 0.0)


@_inline
def _power_and_slope(s, slope, exponent, v):
    """sign(v) |v|^p and its slope; below p = 1 with the smoothed sign ``s``."""
    if v == 0.0:
        return 0.0, 1.0 if exponent == 1.0 else 0.0
    power = abs(v) ** exponent
    if exponent >= 1.0:
        return math.copysign(power, v), exponent * power / abs(v)
    return s * power, slope * power + s * exponent * power / v


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
