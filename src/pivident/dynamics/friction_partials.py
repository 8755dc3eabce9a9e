"""Second derivatives of friction of speed: by the speed, and by the constants of its shape.

The simulator integrates friction f(v; p) with its slope ∂f/∂v, so a tangent of the simulation needs
∂²f/∂v², and along a constant p (γ, v_s and δ of Stribeck friction, the exponent of a power) both
∂f/∂p and ∂²f/∂v∂p.
"""

from __future__ import annotations

import math

from pivident.compiled import inlined as _inline
from pivident.compiled import inner
from pivident.dynamics.elementary import arctangent
from pivident.robot.friction import FrictionColumn
from pivident.robot.friction_term import SignFunction

_COULOMB = int(FrictionColumn.COULOMB)
_POSITIVE = int(FrictionColumn.COULOMB_POSITIVE)
_NEGATIVE = int(FrictionColumn.COULOMB_NEGATIVE)
_STRIBECK = int(FrictionColumn.STRIBECK)
_POWER = int(FrictionColumn.POWER)
_ATAN = int(SignFunction.ATAN)

# Columns of ``FrictionTable.term_value``.
_VALUE, _GAMMA, _FIRST = 0, 1, 2


@_inline
def sign_partials(sign, gamma, v):
    """s, ∂s/∂v, ∂²s/∂v², ∂s/∂γ and ∂²s/∂v∂γ of a smoothed sign."""
    x = gamma * v
    if sign == _ATAN:
        c, r = 2.0 / math.pi, 1.0 / (1.0 + x * x)
        return (
            c * arctangent(x),
            c * gamma * r,
            -2.0 * c * gamma * gamma * x * r * r,
            c * v * r,
            c * r * r * (1.0 - x * x),
        )
    s = math.tanh(x)
    e = 1.0 - s * s
    return s, gamma * e, -2.0 * gamma * gamma * s * e, v * e, e - 2.0 * x * s * e


@_inline
def sign_curvature(sign, gamma, v):
    """∂²s/∂v² of a smoothed sign alone, which takes no arctangent."""
    x = gamma * v
    if sign == _ATAN:
        c, r = 2.0 / math.pi, 1.0 / (1.0 + x * x)
        return -2.0 * c * gamma * gamma * x * r * r
    s = math.tanh(x)
    return -2.0 * gamma * gamma * s * (1.0 - s * s)


@inner
def _stribeck_fall(first, second, v):
    """E = exp(-|v/v_s|^δ), its derivatives by v, v v, v_s, v v_s, δ and v δ."""
    if v == 0.0:
        bend = -2.0 / (first * first) if second == 2.0 else 0.0
        return 1.0, 0.0, bend, 0.0, 0.0, 0.0, 0.0
    ratio = abs(v / first)
    r = ratio**second
    fall = math.exp(-r)
    slope = second * r / v  # dr/dv
    by_first, by_second = -second * r / first, r * math.log(ratio)
    slope_by_first = second / v * by_first
    slope_by_second = (r + second * by_second) / v
    return (
        fall,
        -slope * fall,
        (slope * slope - (second - 1.0) * slope / v) * fall,
        -by_first * fall,
        (slope * by_first - slope_by_first) * fall,
        -by_second * fall,
        (slope * by_second - slope_by_second) * fall,
    )


@inner
def _power_partials(sign, gamma, exponent, v, which):
    """Those of ``speed_partials`` for sign(v) |v|^p; below p = 1 with the smoothed sign."""
    if v == 0.0:
        return 0.0, 0.0, 0.0
    if exponent < 1.0:
        s, s_v, s_vv, s_g, s_vg = sign_partials(sign, gamma, v)
    else:
        s, s_v, s_vv, s_g, s_vg = math.copysign(1.0, v), 0.0, 0.0, 0.0, 0.0
    power, log = abs(v) ** exponent, math.log(abs(v))
    slope = exponent * power / v
    curvature = s_vv * power + 2.0 * s_v * slope + s * (exponent - 1.0) * slope / v
    if which == _GAMMA:
        return curvature, s_g * power, s_vg * power + s_g * slope
    if which == _FIRST:
        rise = s_v * power * log + s * power / v * (1.0 + exponent * log)
        return curvature, s * power * log, rise
    return curvature, 0.0, 0.0


@inner
def speed_partials(column, sign, gamma, first, second, v, which):
    """∂²f/∂v², ∂f/∂p and ∂²f/∂v∂p of one nonlinear term of speed for the constant ``which``.

    ``first second``: v_s and δ; ``which``: a column of ``term_value`` after the parameter: γ, v_s
    or δ.
    """
    if column == _POWER:
        return _power_partials(sign, gamma, first, v, which)
    if column != _COULOMB and column != _POSITIVE and column != _NEGATIVE and column != _STRIBECK:
        return 0.0, 0.0, 0.0
    s, s_v, s_vv, s_g, s_vg = sign_partials(sign, gamma, v)
    if column == _STRIBECK:
        e, e_v, e_vv, e_1, e_v1, e_2, e_v2 = _stribeck_fall(first, second, v)
        curvature = s_vv * e + 2.0 * s_v * e_v + s * e_vv
        if which == _GAMMA:
            return curvature, s_g * e, s_vg * e + s_g * e_v
        if which == _FIRST:
            return curvature, s * e_1, s_v * e_1 + s * e_v1
        return curvature, s * e_2, s_v * e_2 + s * e_v2
    share = 1.0 if column == _COULOMB else 0.5
    if which == _GAMMA:
        return share * s_vv, share * s_g, share * s_vg
    return share * s_vv, 0.0, 0.0


@_inline
def speed_curvature(column, sign, gamma, first, second, v):
    """∂²f/∂v² of one nonlinear term of speed, see ``speed_partials``."""
    if column == _COULOMB:
        return sign_curvature(sign, gamma, v)
    return speed_partials(column, sign, gamma, first, second, v, _GAMMA)[0]
