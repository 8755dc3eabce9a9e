"""Tangents of friction of position and path at the end of a travel; ``path_integration``.

Such friction has a stiffness K beside the slope D, and states, all of which have tangents.
"""

from __future__ import annotations

from pivident.dynamics.friction_table import (
    AHEAD,
    OF_POSITION,
    START_LEVEL,
    STATE,
    accept_states,
    friction_torque,
    path_torque,
)
from pivident.dynamics.path_partials import (
    OF_LEVEL,
    OF_SPEED,
    OF_START,
    OF_STATE,
    OF_TIME,
    OF_TRAVEL,
    OF_VALUES,
    RATE as _RATE_ROW,
    SLOPE,
    STATE as _STATE_ROW,
    STIFFNESS,
    TORQUE,
    path_partials,
)
from pivident.foundation.compiled import inlined as _inline, inner, rows
from pivident.loop.simulation.friction_tangent import PATH, friction_tangent, slope_times_tangent
from pivident.loop.simulation.integration import (
    FRICTION,
    MIDDLE_BIAS,
    NOW,
    STILL,
    Q,
    V,
)
from pivident.loop.simulation.loop_tangent import LENGTH, STILL_TANGENT

#: Scratch row of the copy of the simulation's ``vectors``: the net torque.
(NET,) = rows(23)

#: Scratch rows of the tangents' ``vectors``: of τ - h, see ``freeze_tangent``, and less friction.
NET_TANGENT, FREE_TANGENT = rows(11, 27)


@inner
def friction_after_tangent(
    linear, term_index, term_value, pair_index, pair_value, path_index, path_value, path, at,
    vectors, slopes, row, torque, elapsed, longer, travel, speed, out,
    own, of_travel, of_speed, of_out, of_slopes, of_path, times, constants, constant_slope,
    columns, bends, partials,
):  # fmt: skip
    """As ``path_integration.friction_after``, with the tangents of friction, D, K, and states.

    ``longer``: change of ``elapsed`` with the length of the step; ``of_travel of_speed of_out``:
    rows of ``own``; row ``row`` of ``of_slopes`` and the rows from ``at`` of ``of_path`` receive
    the tangents of what those of ``slopes`` and ``path`` receive.
    """
    n, couplings, directions = own.shape[1], pair_index.shape[0], own.shape[2]
    stiffness = n + 2 * couplings
    friction_torque(
        linear, term_index, term_value, pair_index, pair_value, vectors, speed, out, slopes, row
    )
    friction_tangent(
        term_index, term_value, pair_index, pair_value, constants, constant_slope,
        vectors, speed, slopes, row, own, of_speed, of_out, of_slopes, row, columns, bends,
    )  # fmt: skip
    for j in range(n):
        for d in range(directions):
            of_slopes[row, stiffness + j, d] = 0.0
    for k in range(path_index.shape[0]):
        j, column = path_index[k, 0], path_index[k, 1]
        path_partials(
            column, path_index[k, 2], path[STATE, k], path[START_LEVEL, k],
            vectors[V, j], vectors[speed, j], elapsed,
            vectors[travel, j], vectors[Q, j], path_value, k, partials,
        )  # fmt: skip
        for what in range(_RATE_ROW + 1):
            of_q = partials[what, OF_TRAVEL] if path_index[k, 2] == OF_POSITION else 0.0
            of_z, of_g = partials[what, OF_STATE], partials[what, OF_LEVEL]
            of_v0, of_x = partials[what, OF_START], partials[what, OF_TRAVEL]
            of_v, of_time = partials[what, OF_SPEED], partials[what, OF_TIME] * longer
            for d in range(directions):
                total = (
                    of_z * of_path[STATE, k, d] + of_g * of_path[START_LEVEL, k, d]
                    + of_v0 * own[V, j, d] + of_x * own[of_travel, j, d]
                    + of_v * own[of_speed, j, d] + of_q * own[Q, j, d] + of_time * times[LENGTH, d]
                )  # fmt: skip
                _receive(what, total, k, j, d, at, row, stiffness, own, of_out, of_slopes, of_path)
        for e in range(constants.shape[0]):
            if constants[e, 1] == PATH and constants[e, 2] == k:
                d, weight = constants[e, 4], constant_slope[e]
                for what in range(_RATE_ROW + 1):
                    more = weight * partials[what, OF_VALUES + constants[e, 3]]
                    _add(what, more, k, j, d, at, row, stiffness, own, of_out, of_slopes, of_path)
    path_torque(
        path_index, path_value, path, at, couplings, torque,
        vectors, Q, V, elapsed, travel, speed, out, slopes, row,
    )  # fmt: skip


@inner
def copy_state(
    linear, term_index, term_value, pair_index, pair_value, path_index, path_value, path,
    vectors, slopes, torque, path_copy, vectors_copy, slopes_copy, known,
    own, of_slopes, of_path, times, constants, constant_slope, columns, bends, partials,
):  # fmt: skip
    """Copy the state before a step; with the tangents of friction where they are not ``known``."""
    for k in range(path.shape[0]):
        for e in range(path.shape[1]):
            path_copy[k, e] = path[k, e]
    for k in range(vectors.shape[0]):
        for j in range(vectors.shape[1]):
            vectors_copy[k, j] = vectors[k, j]
    for k in range(slopes.shape[0]):
        for j in range(slopes.shape[1]):
            slopes_copy[k, j] = slopes[k, j]
    if not known:
        friction_after_tangent(
            linear, term_index, term_value, pair_index, pair_value, path_index, path_value,
            path_copy, AHEAD, vectors_copy, slopes_copy, NOW, torque, 0.0, 0.0, STILL, V, FRICTION,
            own, STILL_TANGENT, V, FRICTION, of_slopes, of_path, times, constants, constant_slope,
            columns, bends, partials,
        )  # fmt: skip
        accept_tangent(path_copy, of_path)


@_inline
def _receive(what, total, k, j, d, at, row, stiffness, own, out, of_slopes, of_path):
    """Put a tangent where it belongs; torques and slopes of several entries add up."""
    if what >= _STATE_ROW:
        of_path[at + what - _STATE_ROW, k, d] = total
    else:
        _add(what, total, k, j, d, at, row, stiffness, own, out, of_slopes, of_path)


@_inline
def _add(what, more, k, j, d, at, row, stiffness, own, out, of_slopes, of_path):
    """Add to a tangent."""
    if what == TORQUE:
        own[out, j, d] += more
    elif what == SLOPE:
        of_slopes[row, j, d] += more
    elif what == STIFFNESS:
        of_slopes[row, stiffness + j, d] += more
    else:
        of_path[at + what - _STATE_ROW, k, d] += more


@_inline
def accept_tangent(path, of_path):
    """Make the states ahead those at the start of the next step, with their tangents."""
    accept_states(path)
    for k in range(path.shape[1]):
        for d in range(of_path.shape[2]):
            of_path[STATE, k, d] = of_path[AHEAD, k, d]
            of_path[START_LEVEL, k, d] = of_path[AHEAD + 1, k, d]


@_inline
def change_tangent(
    pair_index, pair_value, slopes, row, of_slopes, vectors, y, x, own, of_y, of_x, out
):
    """Tangent of D y + K x."""
    n, couplings, directions = own.shape[1], pair_index.shape[0], own.shape[2]
    slope_times_tangent(
        pair_index, pair_value, slopes, row, of_slopes, row, vectors, y, own, of_y, out
    )
    for i in range(n):
        k, travel = slopes[row, n + couplings + i], vectors[x, i]
        for d in range(directions):
            own[out, i, d] += (
                k * own[of_x, i, d] + travel * of_slopes[row, n + 2 * couplings + i, d]
            )


@_inline
def lengthen(own, times, row, vectors, source, factor):
    """Add what the length of the step changes: a row of ``vectors`` times ``factor``."""
    for i in range(own.shape[1]):
        for d in range(own.shape[2]):
            own[row, i, d] += factor * vectors[source, i] * times[LENGTH, d]


@_inline
def net_tangent(vectors, torque, friction, own, flat, of_friction):
    """Net torque τ - h - f of the step, and its tangent."""
    for i in range(own.shape[1]):
        vectors[NET, i] = torque[i] - vectors[MIDDLE_BIAS, i] - vectors[friction, i]
    for c in range(flat.shape[1]):
        flat[FREE_TANGENT, c] = flat[NET_TANGENT, c] - flat[of_friction, c]
