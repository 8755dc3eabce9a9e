"""Functions of friction: values and derivatives, and rows of a tile.

Written by ``python -m pivident.dynamics.generate_friction`` from declarations, not by hand.
"""

# fmt: off
# ruff: noqa
from __future__ import annotations

from math import exp, log, sqrt

from pivident.foundation.compiled import inlined
from pivident.dynamics.elementary import TILE, cos, direction, power, sin, size


@inlined
def speed_derivatives(column, s, s_v, s_vv, s_g, s_vg, first, second, dq):
    """What the constants of ``compiled_columns`` count, of a function of speed."""
    if column == 0:  # viscous: dq
        return dq, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    if column == 1:  # coulomb: s
        return s, s_v, s_vv, s_g, s_vg, 0.0, 0.0, 0.0, 0.0
    if column == 2:  # offset: 1
        return 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    if column == 3:  # coulomb_positive: 0.5*(1 + s)
        return 0.5*s + 0.5, 0.5*s_v, 0.5*s_vv, 0.5*s_g, 0.5*s_vg, 0.0, 0.0, 0.0, 0.0
    if column == 4:  # coulomb_negative: -0.5*(1 - s)
        return 0.5*s - 0.5, 0.5*s_v, 0.5*s_vv, 0.5*s_g, 0.5*s_vg, 0.0, 0.0, 0.0, 0.0
    if column == 5:  # stribeck: s*exp(-power(abs(dq/speed), exponent))
        x0 = 1/first
        x1 = dq*x0
        x2 = size(x1)
        x3 = power(x2, second)
        x4 = exp(-x3)
        x5 = s*x4
        x6 = second*x3
        x7 = 1/x2
        x8 = direction(x1)
        x9 = x7*x8
        x10 = x6*x9
        x11 = x0*x10
        x12 = first**(-2)
        x13 = x10*x12
        x14 = s*x9
        x15 = x1*x14
        x16 = log(x2)
        x17 = x0*x14
        return x5, s_v*x4 - x11*x5, x4*(s*x12*x6*x8**2*(-second + x6 + 1)/x2**2 - 2*s_v*x11 + s_vv), s_g*x4, x4*(-s_g*x11 + s_vg), dq*x13*x5, x13*x4*(dq*s_v + s + second*x15 - x15*x6 - x15), -x16*x3*x5, x3*x4*(s*second*x0*x16*x3*x7*x8 - s_v*x16 - second*x16*x17 - x17)
    if column == 6:  # power: s*power(abs(dq), exponent)
        x0 = size(dq)
        x1 = power(x0, first)
        x2 = s*x1
        x3 = direction(dq)
        x4 = x3/x0
        x5 = first*x4
        x6 = log(x0)
        x7 = s*x4
        return x2, s_v*x1 + x2*x5, x1*(first*s*x3**2*(first - 1)/x0**2 + 2*s_v*x5 + s_vv), s_g*x1, x1*(s_g*x5 + s_vg), x2*x6, x1*(first*x6*x7 + s_v*x6 + x7), 0.0, 0.0
    if column == 7:  # viscous_positive: max(dq, 0)
        return max(dq, 0), direction(dq)/2 + 1/2, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    if column == 8:  # viscous_negative: min(dq, 0)
        return min(dq, 0), 1/2 - direction(dq)/2, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    return 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0


@inlined
def speed_row(tile, column, row, value, e, out):
    """A column of the quantity in ``row``, into row ``out``, which holds its sign."""
    first, second = value[e, 3], value[e, 4]
    if column == 3:  # coulomb_positive: 0.5*(1 + s)
        for k in range(TILE):
            tile[out, k] = 0.5*(1 + tile[out, k])
    if column == 4:  # coulomb_negative: -0.5*(1 - s)
        for k in range(TILE):
            tile[out, k] = -0.5*(1 - tile[out, k])
    if column == 5:  # stribeck: s*exp(-power(abs(dq/speed), exponent))
        for k in range(TILE):
            tile[out, k] = tile[out, k]*exp(-power(abs(tile[row, k]/first), second))
    if column == 6:  # power: s*power(abs(dq), exponent)
        for k in range(TILE):
            tile[out, k] = tile[out, k]*power(abs(tile[row, k]), first)
    if column == 7:  # viscous_positive: max(dq, 0)
        for k in range(TILE):
            tile[out, k] = max(tile[row, k], 0)
    if column == 8:  # viscous_negative: min(dq, 0)
        for k in range(TILE):
            tile[out, k] = min(tile[row, k], 0)


@inlined
def position_derivatives(column, first, second, q):
    """What the constants of ``compiled_columns`` count, of a function of position."""
    if column == 9:  # cosine: cos(order*q)
        x0 = first*q
        x1 = cos(x0)
        x2 = sin(x0)
        return x1, -first*x2, -first**2*x1, 0.0, 0.0, -q*x2, -x0*x1 - x2, 0.0, 0.0
    if column == 10:  # sine: sin(order*q)
        x0 = first*q
        x1 = sin(x0)
        x2 = cos(x0)
        return x1, first*x2, -first**2*x1, 0.0, 0.0, q*x2, -x0*x1 + x2, 0.0, 0.0
    if column == 11:  # spring: q
        return q, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    if column == 12:  # strut: sin(q - angle)/sqrt(1 + ratio**2 - 2*ratio*cos(q - angle))
        x0 = first**2
        x1 = q - second
        x2 = cos(x1)
        x3 = 2*x2
        x4 = first*x3
        x5 = sqrt(x0 - x4 + 1)
        x6 = 1/x5
        x7 = sin(x1)
        x8 = x6*x7
        x9 = x5**(-3)
        x10 = x7**2
        x11 = first*x10
        x12 = x11*x9 - x2*x6
        x13 = x5**(-2)
        x14 = -x2
        x15 = first + x14
        return x8, -x12, x8*(first*x13*(3*x11*x13 + x14) - x13*x4 - 1), 0.0, 0.0, -x7*x9*(2*first - x3)/2, x9*(3*first*x10*x13*x15 - x10 - x15*x2), x12, x8*(3*first*x13*x2 - 3*x0*x10/x5**4 + 1)
    if column == 13:  # strut_stiffness: sin(q - angle)
        x0 = q - second
        x1 = sin(x0)
        x2 = cos(x0)
        return x1, x2, -x1, 0.0, 0.0, 0.0, 0.0, -x2, x1
    return 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0


@inlined
def position_row(tile, column, row, value, e, out):
    """A column of the quantity in ``row``, into row ``out``, which holds its sign."""
    first, second = value[e, 3], value[e, 4]
    if column == 9:  # cosine: cos(order*q)
        for k in range(TILE):
            tile[out, k] = cos(first*tile[row, k])
    if column == 10:  # sine: sin(order*q)
        for k in range(TILE):
            tile[out, k] = sin(first*tile[row, k])
    if column == 11:  # spring: q
        for k in range(TILE):
            tile[out, k] = tile[row, k]
    if column == 12:  # strut: sin(q - angle)/sqrt(1 + ratio**2 - 2*ratio*cos(q - angle))
        for k in range(TILE):
            tile[out, k] = sin(tile[row, k] - second)/sqrt(1 + first**2 - 2*first*cos(tile[row, k] - second))
    if column == 13:  # strut_stiffness: sin(q - angle)
        for k in range(TILE):
            tile[out, k] = sin(tile[row, k] - second)
