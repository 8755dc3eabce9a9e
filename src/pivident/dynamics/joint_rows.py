"""Columns without inertial parameter in a tile: rotor, friction, spring and coupling of joints.

They are functions of the motion of one joint or two at one instant; see ``regressor_kernels`` for
the tile, and ``friction`` for friction that needs the path so far.
"""

from __future__ import annotations

import numpy as np

from pivident.dynamics.compiled_columns import FIRST_ADDRESS, VALUE, call_column
from pivident.dynamics.elementary import TILE, arctangent
from pivident.dynamics.entry_plan import ACCELERATION
from pivident.dynamics.friction_generated import position_row, speed_row
from pivident.foundation.compiled import inlined as _inline
from pivident.robot.friction_column import SignFunction
from pivident.robot.friction_terms.offset import OFFSET
from pivident.robot.friction_terms.viscous import VISCOUS

_SPEED, _CONSTANT = int(VISCOUS), int(OFFSET)
_OF_POSITION = int(SignFunction.NONE)
_ATAN, _TANH = int(SignFunction.ATAN), int(SignFunction.TANH)


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
def _called_row(tile, function, row, value, e, out):
    """A column of another distribution of the quantity in a row, where the function is one."""
    if function >= FIRST_ADDRESS:
        for k in range(TILE):
            tile[out, k] = call_column(
                function, VALUE, tile[out, k], 0.0, 0.0, 0.0, 0.0,
                value[e, 3], value[e, 4], tile[row, k],
            )  # fmt: skip


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
    elif sign <= _OF_POSITION:
        position_row(tile, function, q + a, value, e, out)
        _called_row(tile, function, q + a, value, e, out)
    else:
        for s in range(TILE):
            tile[out, s] = tile[dq + a, s] + ratio * tile[dq + b, s]
        _sign_row(tile, sign, gamma, out)
        speed_row(tile, function, dq + a, value, e, out)
        _called_row(tile, function, dq + a, value, e, out)
        _scaled_row(tile, out, factor, out)
