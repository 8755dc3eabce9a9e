"""Partial derivatives of friction of position and path by state, motion and constants.

``friction_table.path_torque`` makes of an entry's state z₀ and level g₀ at the start of a step, the
speeds v₀ and v at its ends, the travel x and the time T between them, and the six values of the
entry: a torque F, its slope D and stiffness K, and the state z, level g and rate dz/dx after the
step. Each of these gets a row of partial derivatives, found by the chain rule line by line, also
through the reversal and through the pieces that travel is cut into.
"""

from __future__ import annotations

import math

import numpy as np

from pivident.dynamics.column_slopes import position_partials
from pivident.dynamics.friction_kernels import (
    LEVEL_PER_PIECE,
    MAX_PIECES,
    level_and_slope,
    position_value_and_slope,
    presliding_state,
    presliding_stiffness,
    slip_state,
    slip_stiffness,
    travel_to_reversal,
)
from pivident.dynamics.friction_table import OF_POSITION
from pivident.foundation.compiled import inner
from pivident.robot.friction_terms.presliding import MAXWELL, PRESLIDING

_PRESLIDING, _MAXWELL = int(PRESLIDING), int(MAXWELL)

#: Columns: z₀, g₀, v₀, x, v and T, then the values of the entry.
OF_STATE, OF_LEVEL, OF_START, OF_TRAVEL, OF_SPEED, OF_TIME, OF_VALUES = 0, 1, 2, 3, 4, 5, 6
INPUTS = 12

# The values of an entry with a state: two parameters, 1/d, ρ, 1/v_s and δ.
_FIRST, _SECOND, _CONSTANT, _EXCESS, _INVERSE, _EXPONENT = 6, 7, 8, 9, 10, 11

#: Rows: F, D, K, then z, g and dz/dx, …
TORQUE, SLOPE, STIFFNESS, STATE, LEVEL, RATE = 0, 1, 2, 3, 4, 5
#: … and those of quantities on the way.
_FALL, _HERE, _LAST, _WAY, _FROM, _TO = 6, 7, 8, 9, 10, 11
PARTIALS = 12


def partials_scratch() -> np.ndarray:
    """Room for the partial derivatives of one entry, shape (PARTIALS, INPUTS)."""
    return np.zeros((PARTIALS, INPUTS))


@inner
def _set(partials, row, column):
    """Make a row the derivative of an input itself; -1: of a constant."""
    for a in range(INPUTS):
        partials[row, a] = 0.0
    if column >= 0:
        partials[row, column] = 1.0


@inner
def _level_partials(excess, inverse_speed, exponent, v, speed, partials, row, slope_row):
    """Rows of the level g and of its slope dg/dv at the speed whose derivatives are a row.

    g = 1 + ρ exp(-r), dg/dv = -δ r (g - 1)/v, r = (|v|/v_s)^δ; ``slope_row``: -1 if not wanted.
    """
    level, fall = level_and_slope(excess, inverse_speed, exponent, v)
    if excess == 0.0 or v == 0.0 or level == 1.0:
        bend = -2.0 * excess * inverse_speed * inverse_speed if exponent == 2.0 else 0.0
        at_rest = v == 0.0 and excess != 0.0
        for a in range(INPUTS):
            partials[row, a] = 0.0
            if slope_row >= 0:
                partials[slope_row, a] = bend * partials[speed, a] if at_rest else 0.0
        if v == 0.0 or inverse_speed == 0.0:
            partials[row, _EXCESS] = 1.0
        return
    ratio = abs(v) * inverse_speed
    power = ratio**exponent
    part, by_inverse = level - 1.0, exponent * power / inverse_speed
    by_exponent = power * math.log(ratio)
    for a in range(INPUTS):
        partials[row, a] = fall * partials[speed, a]
    partials[row, _EXCESS] += part / excess
    partials[row, _INVERSE] -= part * by_inverse
    partials[row, _EXPONENT] -= part * by_exponent
    if slope_row >= 0:
        bend = -fall / v * (1.0 + exponent * (power - 1.0))
        for a in range(INPUTS):
            partials[slope_row, a] = bend * partials[speed, a]
        partials[slope_row, _EXCESS] += fall / excess
        partials[slope_row, _INVERSE] -= exponent / v * by_inverse * part * (1.0 - power)
        partials[slope_row, _EXPONENT] -= (
            part / v * (power + exponent * by_exponent * (1.0 - power))
        )


@inner
def _presliding_partials(z, last, here, x, inverse_distance, partials):
    """Row STATE after a piece of travel, from that before it; see ``presliding_state``."""
    s, both = math.copysign(1.0, x), last + here
    u = 2.0 * abs(x) * inverse_distance / both
    if u < 1e-3:
        mean = 1.0 - 0.5 * u * (1.0 - u / 3.0 * (1.0 - 0.25 * u))
        decay = 1.0 - u * mean
        mean_slope = -0.5 + u / 3.0 - 0.125 * u * u
    else:
        decay = math.exp(-u)
        mean = (1.0 - decay) / u
        mean_slope = (decay - mean) / u
    by_u = -(z - s * last) * decay - s * (here - last) * mean_slope
    for a in range(INPUTS):
        changed = partials[_HERE, a] + partials[_LAST, a]
        of_u = 2.0 * inverse_distance / both * s * partials[_WAY, a] - u * changed / both
        if a == _CONSTANT:
            of_u += u / inverse_distance
        partials[STATE, a] = (
            s * (1.0 - mean) * partials[_HERE, a]
            + decay * partials[STATE, a]
            + s * (mean - decay) * partials[_LAST, a]
            + by_u * of_u
        )


@inner
def _slip_partials(z, here, x, inverse_distance, partials):
    """Row STATE of a Maxwell element after a piece of travel."""
    free = z + x * inverse_distance
    for a in range(INPUTS):
        if abs(free) > here:
            partials[STATE, a] = math.copysign(1.0, free) * partials[_HERE, a]
        else:
            partials[STATE, a] += inverse_distance * partials[_WAY, a]
            if a == _CONSTANT:
                partials[STATE, a] += x


@inner
def _way_partials(column, z, v_start, start_level, v, level, x, values, k, partials):
    """Row STATE after travel in one direction, and z; see ``friction_kernels.state_after_way``.

    Rows of both speeds in _FROM and _TO, of the level at the start in _LAST, of the travel in _WAY.
    """
    constant, excess = values[k, 2], values[k, 3]
    inverse_speed, exponent = values[k, 4], values[k, 5]
    pieces = 1
    if abs(level - start_level) > LEVEL_PER_PIECE:
        pieces = min(math.ceil(abs(level - start_level) / LEVEL_PER_PIECE), MAX_PIECES)
    part, square, last = x / pieces, v_start * v_start, start_level
    for a in range(INPUTS):
        partials[_WAY, a] /= pieces
    for i in range(1, pieces + 1):
        share = i / pieces
        here, speed = level, v
        if i < pieces:
            speed = math.sqrt(square + share * (v * v - square))
            here, _ = level_and_slope(excess, inverse_speed, exponent, speed)
        for a in range(INPUTS):
            partials[_FALL, a] = partials[_TO, a]
            if i < pieces and speed > 0.0:
                partials[_FALL, a] = (
                    (1.0 - share) * v_start * partials[_FROM, a] + share * v * partials[_TO, a]
                ) / speed
        _level_partials(excess, inverse_speed, exponent, speed, _FALL, partials, _HERE, -1)
        if column == _PRESLIDING:
            _presliding_partials(z, last, here, part, constant, partials)
            z = presliding_state(z, last, here, part, constant)
        else:
            _slip_partials(z, here, part, constant, partials)
            z = slip_state(z, here, part, constant)
        last = here
        for a in range(INPUTS):
            partials[_LAST, a] = partials[_HERE, a]
    return z


@inner
def _memory_partials(column, z, start_level, v_start, v, elapsed, x, values, k, partials):
    """All rows of an entry with a state."""
    first, second, constant = values[k, 0], values[k, 1], values[k, 2]
    excess, inverse_speed, exponent = values[k, 3], values[k, 4], values[k, 5]
    level, fall = level_and_slope(excess, inverse_speed, exponent, v)
    _set(partials, STATE, OF_STATE)
    _set(partials, _LAST, OF_LEVEL)
    _set(partials, _WAY, OF_TRAVEL)
    _set(partials, _FROM, OF_START)
    if v_start * v < 0.0:
        way = travel_to_reversal(v_start, v, elapsed)
        _set(partials, _TO, -1)
        _set(partials, _WAY, -1)
        slower = v_start - v
        by_start = 0.5 * v_start * elapsed * (v_start - 2.0 * v) / (slower * slower)
        by_end, by_time = way / slower, way / elapsed
        partials[_WAY, OF_START], partials[_WAY, OF_SPEED] = by_start, by_end
        partials[_WAY, OF_TIME] = by_time
        z = _way_partials(
            column, z, v_start, start_level, 0.0, 1.0 + excess, way, values, k, partials
        )
        _set(partials, _FROM, -1)
        _set(partials, _LAST, _EXCESS)
        _set(partials, _WAY, OF_TRAVEL)
        partials[_WAY, OF_START], partials[_WAY, OF_SPEED] = -by_start, -by_end
        partials[_WAY, OF_TIME] = -by_time
        v_start, start_level, x = 0.0, 1.0 + excess, x - way
    _set(partials, _TO, OF_SPEED)
    z = _way_partials(column, z, v_start, start_level, v, level, x, values, k, partials)
    _level_partials(excess, inverse_speed, exponent, v, _TO, partials, LEVEL, _FALL)
    if column == _PRESLIDING:
        rate, s = presliding_stiffness(z, level, v, constant), math.copysign(1.0, v)
        speed, damping, kept = abs(v), second * rate / constant, 0.0 if v == 0.0 else s * constant
        square = level * level
        hold = first - second * speed / level
        for a in range(INPUTS):
            of_z, of_g = partials[STATE, a], partials[LEVEL, a]
            of_v = 1.0 if a == OF_SPEED else 0.0
            of_first = 1.0 if a == _FIRST else 0.0
            of_second = 1.0 if a == _SECOND else 0.0
            of_constant = 1.0 if a == _CONSTANT else 0.0
            of_rate = of_constant * rate / constant - kept * (of_z / level - z * of_g / square)
            of_damping = (
                of_second * rate + second * (of_rate - rate * of_constant / constant)
            ) / constant
            partials[RATE, a] = of_rate
            partials[TORQUE, a] = of_first * z + first * of_z + of_damping * v + damping * of_v
            partials[SLOPE, a] = (
                of_damping
                + (
                    of_second * speed * z * fall
                    + second
                    * (s * of_v * z * fall + speed * (of_z * fall + z * partials[_FALL, a]))
                    - 2.0 * second * speed * z * fall * of_g / level
                )
                / square
            )
            partials[STIFFNESS, a] = hold * of_rate + rate * (
                of_first
                - (of_second * speed + second * s * of_v) / level
                + second * speed * of_g / square
            )
        return
    rate, s = slip_stiffness(z, level, v, constant), math.copysign(1.0, z)
    for a in range(INPUTS):
        of_first = 1.0 if a == _FIRST else 0.0
        of_rate = 1.0 if a == _CONSTANT and rate != 0.0 else 0.0
        partials[RATE, a] = of_rate
        partials[TORQUE, a] = of_first * z + first * partials[STATE, a]
        partials[STIFFNESS, a] = of_first * rate + first * of_rate
        partials[SLOPE, a] = 0.0
        if rate == 0.0:
            partials[SLOPE, a] = s * (of_first * fall + first * partials[_FALL, a])


@inner
def path_partials(
    column, sign, z, start_level, v_start, v, elapsed, x, position, values, k, partials
):  # fmt: skip
    """Partial derivatives of entry ``k`` of the path table, rows TORQUE to RATE of ``partials``.

    ``z start_level v_start position``: at the start of the step; ``x``: travel since; ``values``:
    ``FrictionTable.path_value``. The position counts like the travel. Springs, which belong to the
    rigid body, and friction of the load have none.
    """
    for row in range(RATE + 1):
        _set(partials, row, -1)
    if sign == OF_POSITION:
        first, constant, other, at = values[k, 0], values[k, 2], values[k, 3], position + x
        value, slope = position_value_and_slope(column, constant, other, at)
        partials[TORQUE, OF_TRAVEL], partials[TORQUE, _FIRST] = first * slope, value
        partials[STIFFNESS, _FIRST] = slope
        for which in range(2):
            bend, f, rise = position_partials(column, constant, other, at, which + 2)
            partials[STIFFNESS, OF_TRAVEL] = first * bend
            partials[TORQUE, _CONSTANT + which] = first * f
            partials[STIFFNESS, _CONSTANT + which] = first * rise
    elif column == _PRESLIDING or column == _MAXWELL:
        _memory_partials(column, z, start_level, v_start, v, elapsed, x, values, k, partials)


@inner
def position_slopes(path_index, path_value, vectors, position, by_position, kinds):
    """Add ∂τ/∂q at the positions of a row to a matrix; ``kinds``: see ``position_torque``."""
    for k in range(path_index.shape[0]):
        if path_index[k, 2] <= kinds:
            j = path_index[k, 0]
            _, slope = position_value_and_slope(
                path_index[k, 1], path_value[k, 2], path_value[k, 3], vectors[position, j]
            )
            by_position[j, j] += path_value[k, 0] * slope


@inner
def position_partial(path_index, path_value, k, column, q, kinds):
    """Derivative of the torque of a function of the position by one of its values; else zero."""
    function, first, second = path_index[k, 1], path_value[k, 2], path_value[k, 3]
    if path_index[k, 2] > kinds or column == 1:
        return 0.0
    if column == 0:
        return position_value_and_slope(function, first, second, q)[0]
    return path_value[k, 0] * position_partials(function, first, second, q, column)[1]
