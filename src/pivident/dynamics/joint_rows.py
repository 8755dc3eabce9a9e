"""Columns without inertial parameter in a tile: rotor, friction, spring and coupling of joints.

They are functions of the motion of one joint or two at one instant; see ``regressor_kernels`` for
the tile, and ``friction`` for friction that needs the path so far.
"""

from __future__ import annotations

import numpy as np

from pivident.compiled import inlined as _inline
from pivident.dynamics.elementary import arctangent, sine_and_cosine
from pivident.dynamics.entry_plan import ACCELERATION
from pivident.robot.friction import FrictionColumn
from pivident.robot.friction_term import SignFunction

TILE = 128  # samples: long enough to vectorise, short enough for the caches

_SPEED, _CONSTANT = int(FrictionColumn.VISCOUS), int(FrictionColumn.OFFSET)
_POSITIVE = int(FrictionColumn.COULOMB_POSITIVE)
_NEGATIVE = int(FrictionColumn.COULOMB_NEGATIVE)
_STRIBECK = int(FrictionColumn.STRIBECK)
_POWER = int(FrictionColumn.POWER)
_FORWARDS = int(FrictionColumn.VISCOUS_POSITIVE)
_BACKWARDS = int(FrictionColumn.VISCOUS_NEGATIVE)
_COSINE, _SINE = int(FrictionColumn.COSINE), int(FrictionColumn.SINE)
_SPRING, _STRUT = int(FrictionColumn.SPRING), int(FrictionColumn.STRUT)
_STRUT_STIFFNESS = int(FrictionColumn.STRUT_STIFFNESS)
_HARD, _ATAN, _TANH = int(SignFunction.SIGN), int(SignFunction.ATAN), int(SignFunction.TANH)


@_inline
def _scaled_row(tile, source, factor, target):
    for s in range(TILE):
        tile[target, s] = factor * tile[source, s]


@_inline
def _sign_row(tile, sign, gamma, row):
    """The (smoothed) sign function of a row, in place."""
    if sign == _ATAN:
        for s in range(TILE):
            tile[row, s] = (2.0 / np.pi) * arctangent(gamma * tile[row, s])
    elif sign == _TANH:
        for s in range(TILE):
            tile[row, s] = np.tanh(gamma * tile[row, s])
    else:
        for s in range(TILE):
            tile[row, s] = np.sign(tile[row, s])


@_inline
def _position_row(tile, function, q, value, e, out):
    """Ripple, spring and strut: a function of the position in row ``q``."""
    if function == _SPRING:
        _scaled_row(tile, q, 1.0, out)
    elif function == _COSINE:
        order = value[e, 3]
        for s in range(TILE):
            tile[out, s] = sine_and_cosine(order * tile[q, s])[1]
    elif function == _SINE:
        order = value[e, 3]
        for s in range(TILE):
            tile[out, s] = sine_and_cosine(order * tile[q, s])[0]
    elif function == _STRUT:
        ratio, angle = value[e, 3], value[e, 4]
        for s in range(TILE):
            sine, cosine = sine_and_cosine(tile[q, s] - angle)
            tile[out, s] = sine / np.sqrt(1.0 + ratio * ratio - 2.0 * ratio * cosine)
    else:
        angle = value[e, 4]
        for s in range(TILE):
            tile[out, s] = sine_and_cosine(tile[q, s] - angle)[0]


@_inline
def _speed_row(tile, function, sign, speed, value, e, out):
    """Viscous friction by direction or with a power of the speed in row ``speed``."""
    if function == _FORWARDS:
        for s in range(TILE):
            tile[out, s] = max(tile[speed, s], 0.0)
    elif function == _BACKWARDS:
        for s in range(TILE):
            tile[out, s] = min(tile[speed, s], 0.0)
    else:
        exponent = value[e, 3]
        _scaled_row(tile, speed, 1.0, out)
        _sign_row(tile, sign if exponent < 1.0 else _HARD, value[e, 2], out)
        for s in range(TILE):
            tile[out, s] *= abs(tile[speed, s]) ** exponent


@_inline
def joint_row(tile, q, dq, ddq, index, value, e, out):
    """Entry e without inertial parameter: a function of the motion of one joint or two."""
    function, sign, a, b = index[e, 0], index[e, 1], index[e, 2], index[e, 3]
    factor, ratio, gamma = value[e, 0], value[e, 1], value[e, 2]
    if function == ACCELERATION:
        _scaled_row(tile, ddq + a, factor, out)
    elif function == _SPEED:
        _scaled_row(tile, dq + a, factor, out)
    elif function == _CONSTANT:
        for s in range(TILE):
            tile[out, s] = factor
    elif _COSINE <= function <= _STRUT_STIFFNESS:
        _position_row(tile, function, q + a, value, e, out)
    elif _POWER <= function <= _BACKWARDS:
        _speed_row(tile, function, sign, dq + a, value, e, out)
    else:
        for s in range(TILE):
            tile[out, s] = tile[dq + a, s] + ratio * tile[dq + b, s]
        _sign_row(tile, sign, gamma, out)
        if function == _POSITIVE:
            for s in range(TILE):
                tile[out, s] = 0.5 * (1.0 + tile[out, s])
        elif function == _NEGATIVE:
            for s in range(TILE):
                tile[out, s] = -0.5 * (1.0 - tile[out, s])
        elif function == _STRIBECK:
            speed, exponent = value[e, 3], value[e, 4]
            for s in range(TILE):
                tile[out, s] *= np.exp(-(abs(tile[dq + a, s] / speed) ** exponent))
        _scaled_row(tile, out, factor, out)
