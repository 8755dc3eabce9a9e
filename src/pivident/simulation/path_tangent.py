"""Tangent of one step of the simulation with friction of position and path; ``path_integration``.

The step is taken once more, on copies of the state before it, with its tangents beside it. As with
friction of speed alone, what the scheme decides stays as it is: the rule that is used, the count of
inner steps and their shares of the step.
"""

from __future__ import annotations

import numpy as np

from pivident.compiled import inlined as _inline
from pivident.compiled import inner, rows
from pivident.dynamics.friction_table import (
    AHEAD,
    MIDWAY,
    RATE,
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
    SLOPE,
    STIFFNESS,
    TORQUE,
    path_partials,
)
from pivident.dynamics.path_partials import RATE as _RATE_ROW
from pivident.dynamics.path_partials import STATE as _STATE_ROW
from pivident.robot.friction import FrictionColumn
from pivident.simulation.friction_tangent import PATH, friction_tangent, slope_times_tangent
from pivident.simulation.integration import (
    FRICTION,
    LEVEL,
    LINEAR_REMAINDER,
    MAX_INNER_STEPS,
    MIDDLE,
    MIDDLE_BIAS,
    NONLINEAR_STIFFNESS,
    NOW,
    STIFFNESS_PER_STEP,
    STILL,
    THEN,
    Q,
    V,
    apply_matrix,
    subtract_product,
)
from pivident.simulation.loop_tangent import LENGTH, STILL_TANGENT
from pivident.simulation.path_integration import (
    NONLINEAR_OSCILLATION,
    OSCILLATION_PER_STEP,
    SIMPSON_DIFFERENCE,
    SIMPSON_FEEDBACK,
    change,
    inner_steps,
    path_stiffness,
    rate_at_reversals,
)
from pivident.simulation.rigid_body_tangent import product_tangent

_COSINE = int(FrictionColumn.COSINE)

# Scratch rows of the copy of the simulation's ``vectors``, as in ``path_integration``.
_A0, _A, _Y, _X, _Z, _W, _AHEAD, _REST = rows(9, 10, 11, 12, 13, 14, 15, 16)
_T, _MIDWAY_SPEED, _MIDWAY_TRAVEL, _MIDWAY_REST, _DX, _NET = rows(18, 19, 20, 21, 22, 23)

# Scratch rows of the tangents' ``vectors``.
_NET_T, _A0_T, _A_T, _Y_T, _X_T, _Z_T, _W_T, _AHEAD_T, _REST_T = rows(
    11, 12, 13, 14, 15, 16, 17, 18, 19
)
_T_T, _MIDWAY_SPEED_T, _MIDWAY_TRAVEL_T, _MIDWAY_REST_T, _DX_T, _F_T, _FREE_T = rows(
    20, 21, 22, 24, 25, 26, 27
)

#: Row of ``slopes`` midway.
(_BETWEEN,) = rows(2)


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
            column, path[STATE, k], path[START_LEVEL, k], vectors[V, j], vectors[speed, j],
            elapsed, vectors[travel, j], vectors[Q, j], path_value, k, partials,
        )  # fmt: skip
        for what in range(_RATE_ROW + 1):
            of_q = partials[what, OF_TRAVEL] if column == _COSINE else 0.0
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
        _accept(path_copy, of_path)


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
def _accept(path, of_path):
    """Make the states ahead those at the start of the next step, with their tangents."""
    accept_states(path)
    for k in range(path.shape[1]):
        for d in range(of_path.shape[2]):
            of_path[STATE, k, d] = of_path[AHEAD, k, d]
            of_path[START_LEVEL, k, d] = of_path[AHEAD + 1, k, d]


@_inline
def _change_tangent(
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
def _net_tangent(vectors, torque, friction, own, flat, of_friction):
    """Net torque τ - h - f of the step, and its tangent."""
    for i in range(own.shape[1]):
        vectors[_NET, i] = torque[i] - vectors[MIDDLE_BIAS, i] - vectors[friction, i]
    for c in range(flat.shape[1]):
        flat[_FREE_T, c] = flat[_NET_T, c] - flat[of_friction, c]


@_inline
def _lengthen(own, times, row, vectors, source, factor):
    """Add what the length of the step changes: a row of ``vectors`` times ``factor``."""
    for i in range(own.shape[1]):
        for d in range(own.shape[2]):
            own[row, i, d] += factor * vectors[source, i] * times[LENGTH, d]


@inner
def _linear_tangent(
    pair_index, pair_value, vectors, matrices, slopes, h, own, flat, layers, of_slopes, times
):
    """Linear step with its tangents; returns ‖M⁻¹D‖·h + ‖M⁻¹K‖·h²."""
    n, width = own.shape[1], flat.shape[1]
    rate, square = path_stiffness(pair_index, pair_value, matrices, slopes, NOW)
    wanted = inner_steps(rate, square, h, STIFFNESS_PER_STEP, OSCILLATION_PER_STEP)
    count = int(np.ceil(min(max(wanted, 1e-3), MAX_INNER_STEPS)))
    step, longer = h / count, 1.0 / count
    for i in range(n):
        vectors[_Y, i], vectors[_X, i], vectors[_A, i] = 0.0, 0.0, vectors[_A0, i]
    for c in range(width):
        flat[_Y_T, c], flat[_X_T, c], flat[_A_T, c] = 0.0, 0.0, flat[_A0_T, c]
    for s in range(count):
        for i in range(n):
            vectors[_W, i] = step * vectors[_A, i]
            vectors[_T, i] = step * (vectors[V, i] + vectors[_Y, i])
        for c in range(width):
            flat[_W_T, c] = step * flat[_A_T, c]
            flat[_T_T, c] = step * (flat[V, c] + flat[_Y_T, c])
        _lengthen(own, times, _W_T, vectors, _A, longer)
        _lengthen(own, times, _T_T, vectors, V, longer)
        _lengthen(own, times, _T_T, vectors, _Y, longer)
        for i in range(n):
            vectors[_Y, i] += vectors[_W, i]
            vectors[_X, i] += vectors[_T, i]
        for c in range(width):
            flat[_Y_T, c] += flat[_W_T, c]
            flat[_X_T, c] += flat[_T_T, c]
        for order in range(2, 5):
            part = step / order
            change(pair_index, pair_value, slopes, NOW, vectors, _W, _T, _Z)
            _change_tangent(
                pair_index, pair_value, slopes, NOW, of_slopes, vectors, _W, _T, own, _W_T, _T_T,
                _Z_T,
            )  # fmt: skip
            for c in range(width):
                flat[_T_T, c] = part * flat[_W_T, c]
            _lengthen(own, times, _T_T, vectors, _W, longer / order)
            for i in range(n):
                vectors[_T, i] = part * vectors[_W, i]
                vectors[_X, i] += vectors[_T, i]
            product_tangent(
                matrices, vectors, _Z, own, layers, _Z_T, part, longer / order, times,
                STILL_TANGENT, _W_T,
            )  # fmt: skip
            subtract_product(matrices, vectors, _Z, part, STILL, _W)
            for c in range(width):
                flat[_X_T, c] += flat[_T_T, c]
                flat[_Y_T, c] += flat[_W_T, c]
            for i in range(n):
                vectors[_Y, i] += vectors[_W, i]
        for c in range(width):
            flat[_X_T, c] += 0.2 * step * flat[_W_T, c]
        _lengthen(own, times, _X_T, vectors, _W, 0.2 * longer)
        for i in range(n):
            vectors[_X, i] += 0.2 * step * vectors[_W, i]
        if s < count - 1:
            change(pair_index, pair_value, slopes, NOW, vectors, _Y, _X, _Z)
            _change_tangent(
                pair_index, pair_value, slopes, NOW, of_slopes, vectors, _Y, _X, own, _Y_T, _X_T,
                _Z_T,
            )  # fmt: skip
            product_tangent(matrices, vectors, _Z, own, layers, _Z_T, 1.0, 0.0, times, _A0_T, _A_T)
            subtract_product(matrices, vectors, _Z, 1.0, _A0, _A)
    return rate * h + square * h * h


@inner
def path_step_tangent(
    linear, term_index, term_value, pair_index, pair_value, path_index, path_value, path,
    vectors, matrices, slopes, torque, h,
    own, flat, layers, times, of_slopes, of_path, constants, constant_slope, columns, bends, partials,
):  # fmt: skip
    """Carry the tangents over the step that ``advance_on_path`` has taken.

    ``path vectors slopes``: copies of the state before the step; τ - h of its middle is in the row
    _NET_T, see ``step_tangent.freeze_tangent``.
    """
    n, width = own.shape[1], flat.shape[1]
    _net_tangent(vectors, torque, FRICTION, own, flat, FRICTION)
    apply_matrix(matrices, MIDDLE, vectors, torque, MIDDLE_BIAS, FRICTION, _A0)
    product_tangent(
        matrices, vectors, _NET, own, layers, _FREE_T, -1.0, 0.0, times, STILL_TANGENT, _A0_T
    )
    feedback = _linear_tangent(
        pair_index, pair_value, vectors, matrices, slopes, h, own, flat, layers, of_slopes, times
    )
    change(pair_index, pair_value, slopes, NOW, vectors, _Y, _X, _Z)
    _change_tangent(
        pair_index, pair_value, slopes, NOW, of_slopes, vectors, _Y, _X, own, _Y_T, _X_T, _Z_T
    )
    for i in range(n):
        vectors[_AHEAD, i] = vectors[V, i] + vectors[_Y, i]
    for c in range(width):
        flat[_AHEAD_T, c] = flat[V, c] + flat[_Y_T, c]
    friction_after_tangent(
        linear, term_index, term_value, pair_index, pair_value, path_index, path_value, path, AHEAD,
        vectors, slopes, THEN, torque, h, 1.0, _X, _AHEAD, _REST,
        own, _X_T, _AHEAD_T, _F_T, of_slopes, of_path, times, constants, constant_slope,
        columns, bends, partials,
    )  # fmt: skip
    turning = rate_at_reversals(pair_index, pair_value, matrices, slopes, vectors, V, _AHEAD)
    sudden = turning * h > NONLINEAR_STIFFNESS
    small = not sudden
    for i in range(n):
        vectors[_REST, i] -= vectors[FRICTION, i] + vectors[_Z, i]
        if not abs(vectors[_REST, i]) <= LINEAR_REMAINDER * vectors[LEVEL, i]:
            small = False
    for c in range(width):
        flat[_REST_T, c] = flat[_F_T, c] - flat[FRICTION, c] - flat[_Z_T, c]
    simpson = False
    if not small and not sudden:
        simpson = _simpson_tangent(
            linear, term_index, term_value, pair_index, pair_value, path_index, path_value, path,
            vectors, slopes, matrices, torque, h, feedback,
            own, flat, layers, times, of_slopes, of_path, constants, constant_slope, columns, bends,
            partials,
        )  # fmt: skip
    if not small and not simpson:
        _nonlinear_tangent(
            linear, term_index, term_value, pair_index, pair_value, path_index, path_value, path,
            vectors, matrices, slopes, torque, h,
            own, flat, layers, times, of_slopes, of_path, constants, constant_slope, columns, bends,
            partials,
        )  # fmt: skip
        return
    if small:
        product_tangent(
            matrices, vectors, _REST, own, layers, _REST_T, h / 3.0, 1.0 / 3.0, times, _AHEAD_T, V
        )
        subtract_product(matrices, vectors, _REST, h / 3.0, _AHEAD, V)
        for i in range(n):
            vectors[_DX, i] = 0.25 * (vectors[V, i] - vectors[_AHEAD, i])
        for c in range(width):
            flat[_DX_T, c] = 0.25 * h * (flat[V, c] - flat[_AHEAD_T, c])
        _lengthen(own, times, _DX_T, vectors, _DX, 1.0)
        for i in range(n):
            vectors[_DX, i] = 0.25 * h * (vectors[V, i] - vectors[_AHEAD, i])
    for i in range(n):
        vectors[_A, i] = vectors[V, i] - vectors[_AHEAD, i]
    for c in range(width):
        flat[_A_T, c] = flat[V, c] - flat[_AHEAD_T, c]
        flat[Q, c] += flat[_X_T, c] + flat[_DX_T, c]
    _change_tangent(
        pair_index, pair_value, slopes, THEN, of_slopes, vectors, _A, _DX, own, _A_T, _DX_T, _Z_T
    )
    for c in range(width):
        flat[FRICTION, c] = flat[_F_T, c] + flat[_Z_T, c]
    for k in range(path.shape[1]):
        j = path_index[k, 0]
        for d in range(own.shape[2]):
            of_path[AHEAD, k, d] += (
                path[RATE, k] * own[_DX_T, j, d] + vectors[_DX, j] * of_path[RATE, k, d]
            )
    _accept(path, of_path)
    for k in range(of_slopes.shape[1]):
        for d in range(own.shape[2]):
            of_slopes[NOW, k, d] = of_slopes[THEN, k, d]


@inner
def _simpson_tangent(
    linear, term_index, term_value, pair_index, pair_value, path_index, path_value, path,
    vectors, slopes, matrices, torque, h, feedback,
    own, flat, layers, times, of_slopes, of_path, constants, constant_slope, columns, bends, partials,
):  # fmt: skip
    """Correction by Simpson's rule with its tangents; whether the simulation took it."""
    n, width = own.shape[1], flat.shape[1]
    for i in range(n):
        if not feedback * abs(vectors[_REST, i]) <= SIMPSON_FEEDBACK * vectors[LEVEL, i]:
            return False
    product_tangent(
        matrices, vectors, _Z, own, layers, _Z_T, -0.125 * h, -0.125, times, STILL_TANGENT,
        _MIDWAY_SPEED_T,
    )  # fmt: skip
    subtract_product(matrices, vectors, _Z, -0.125 * h, STILL, _MIDWAY_SPEED)
    for i in range(n):
        vectors[_W, i] = vectors[_MIDWAY_SPEED, i] + 0.5 * vectors[_Y, i]
        vectors[_MIDWAY_SPEED, i] = vectors[V, i] + vectors[_W, i]
        vectors[_MIDWAY_TRAVEL, i] = 0.5 * vectors[_X, i] - 0.125 * h * vectors[_Y, i]
    for c in range(width):
        flat[_W_T, c] = flat[_MIDWAY_SPEED_T, c] + 0.5 * flat[_Y_T, c]
        flat[_MIDWAY_SPEED_T, c] = flat[V, c] + flat[_W_T, c]
        flat[_MIDWAY_TRAVEL_T, c] = 0.5 * flat[_X_T, c] - 0.125 * h * flat[_Y_T, c]
    _lengthen(own, times, _MIDWAY_TRAVEL_T, vectors, _Y, -0.125)
    friction_after_tangent(
        linear, term_index, term_value, pair_index, pair_value, path_index, path_value, path,
        MIDWAY, vectors, slopes, _BETWEEN, torque, 0.5 * h, 0.5,
        _MIDWAY_TRAVEL, _MIDWAY_SPEED, _MIDWAY_REST,
        own, _MIDWAY_TRAVEL_T, _MIDWAY_SPEED_T, _MIDWAY_REST_T, of_slopes, of_path, times,
        constants, constant_slope, columns, bends, partials,
    )  # fmt: skip
    change(pair_index, pair_value, slopes, NOW, vectors, _W, _MIDWAY_TRAVEL, _T)
    _change_tangent(
        pair_index, pair_value, slopes, NOW, of_slopes, vectors, _W, _MIDWAY_TRAVEL,
        own, _W_T, _MIDWAY_TRAVEL_T, _T_T,
    )  # fmt: skip
    for c in range(width):
        flat[_MIDWAY_REST_T, c] -= flat[FRICTION, c] + flat[_T_T, c]
        flat[_T_T, c] = 4.0 * flat[_MIDWAY_REST_T, c] + flat[_REST_T, c]
    for i in range(n):
        vectors[_MIDWAY_REST, i] -= vectors[FRICTION, i] + vectors[_T, i]
        vectors[_T, i] = 4.0 * vectors[_MIDWAY_REST, i] + vectors[_REST, i]
        difference = abs(4.0 * vectors[_MIDWAY_REST, i] - vectors[_REST, i]) / 6.0
        if not difference <= SIMPSON_DIFFERENCE * vectors[LEVEL, i]:
            return False
    product_tangent(
        matrices, vectors, _T, own, layers, _T_T, h / 6.0, 1.0 / 6.0, times, _AHEAD_T, V
    )
    subtract_product(matrices, vectors, _T, h / 6.0, _AHEAD, V)
    product_tangent(
        matrices, vectors, _MIDWAY_REST, own, layers, _MIDWAY_REST_T, h * h / 3.0, 2.0 * h / 3.0,
        times, STILL_TANGENT, _DX_T,
    )  # fmt: skip
    subtract_product(matrices, vectors, _MIDWAY_REST, h * h / 3.0, STILL, _DX)
    return True


@inner
def _nonlinear_tangent(
    linear, term_index, term_value, pair_index, pair_value, path_index, path_value, path,
    vectors, matrices, slopes, torque, h,
    own, flat, layers, times, of_slopes, of_path, constants, constant_slope, columns, bends, partials,
):  # fmt: skip
    """Runge–Kutta 4 on travel and speed with its tangents."""
    n, width = own.shape[1], flat.shape[1]
    k1, k2, k3, k4, trial, f, travel = _A0, _A, _Y, _X, _Z, _W, _T
    k1_t, k2_t, k3_t, k4_t, trial_t, travel_t = _A0_T, _A_T, _Y_T, _X_T, _Z_T, _T_T
    left, shortest = h, h / MAX_INNER_STEPS
    for i in range(n):
        vectors[f, i] = vectors[FRICTION, i]
    for c in range(width):
        flat[_F_T, c] = flat[FRICTION, c]
    for k in range(slopes.shape[1]):
        slopes[1, k] = slopes[0, k]
    while left > 1e-9 * h:
        rate, square = path_stiffness(pair_index, pair_value, matrices, slopes, THEN)
        count = inner_steps(rate, square, left, NONLINEAR_STIFFNESS, NONLINEAR_OSCILLATION)
        step = min(max(left / np.ceil(max(count, 1e-3)), shortest), left)
        _net_tangent(vectors, torque, f, own, flat, _F_T)
        apply_matrix(matrices, MIDDLE, vectors, torque, MIDDLE_BIAS, f, k1)
        product_tangent(
            matrices, vectors, _NET, own, layers, _FREE_T, -1.0, 0.0, times, STILL_TANGENT, k1_t
        )
        stage = 1
        while stage < 4:
            last = k1 if stage == 1 else (k2 if stage == 2 else k3)
            last_t = k1_t if stage == 1 else (k2_t if stage == 2 else k3_t)
            weight = 1.0 if stage == 3 else 0.5
            longer = weight * step / h
            for i in range(n):
                before = vectors[V, i] if stage == 1 else vectors[trial, i]
                vectors[travel, i] = weight * step * before
            for c in range(width):
                before = flat[V, c] if stage == 1 else flat[trial_t, c]
                flat[travel_t, c] = weight * step * before
                flat[trial_t, c] = flat[V, c] + weight * step * flat[last_t, c]
            _lengthen(own, times, travel_t, vectors, V if stage == 1 else trial, longer)
            _lengthen(own, times, trial_t, vectors, last, longer)
            for i in range(n):
                vectors[trial, i] = vectors[V, i] + weight * step * vectors[last, i]
            friction_after_tangent(
                linear, term_index, term_value, pair_index, pair_value, path_index, path_value,
                path, AHEAD, vectors, slopes, THEN, torque, weight * step, longer, travel, trial, f,
                own, travel_t, trial_t, _F_T, of_slopes, of_path, times, constants, constant_slope,
                columns, bends, partials,
            )  # fmt: skip
            rate, square = path_stiffness(pair_index, pair_value, matrices, slopes, THEN)
            rate = max(
                rate, rate_at_reversals(pair_index, pair_value, matrices, slopes, vectors, V, trial)
            )
            ahead = inner_steps(rate, square, step, NONLINEAR_STIFFNESS, NONLINEAR_OSCILLATION)
            if ahead > 1.5 and step > shortest:
                step = max(step / ahead, shortest)
                stage = 1
                continue
            target = k2 if stage == 1 else (k3 if stage == 2 else k4)
            target_t = k2_t if stage == 1 else (k3_t if stage == 2 else k4_t)
            _net_tangent(vectors, torque, f, own, flat, _F_T)
            apply_matrix(matrices, MIDDLE, vectors, torque, MIDDLE_BIAS, f, target)
            product_tangent(
                matrices, vectors, _NET, own, layers, _FREE_T, -1.0, 0.0, times, STILL_TANGENT,
                target_t,
            )  # fmt: skip
            stage += 1
        longer = step / h
        for c in range(width):
            within = flat[k2_t, c] + flat[k3_t, c]
            flat[travel_t, c] = step * (flat[V, c] + step / 6.0 * (flat[k1_t, c] + within))
            flat[trial_t, c] = flat[V, c] + step / 6.0 * (
                flat[k1_t, c] + 2.0 * within + flat[k4_t, c]
            )
        for i in range(n):
            inside = vectors[k2, i] + vectors[k3, i]
            gained = (vectors[k1, i] + 2.0 * inside + vectors[k4, i]) / 6.0
            way = vectors[V, i] + step / 3.0 * (vectors[k1, i] + inside)
            for d in range(own.shape[2]):
                own[travel_t, i, d] += longer * way * times[LENGTH, d]
                own[trial_t, i, d] += longer * gained * times[LENGTH, d]
            vectors[travel, i] = step * (vectors[V, i] + step / 6.0 * (vectors[k1, i] + inside))
            gained = step / 6.0 * (vectors[k1, i] + 2.0 * inside + vectors[k4, i])
            vectors[trial, i] = vectors[V, i] + gained
        friction_after_tangent(
            linear, term_index, term_value, pair_index, pair_value, path_index, path_value, path,
            AHEAD, vectors, slopes, THEN, torque, step, longer, travel, trial, f,
            own, travel_t, trial_t, _F_T, of_slopes, of_path, times, constants, constant_slope,
            columns, bends, partials,
        )  # fmt: skip
        _accept(path, of_path)
        for i in range(n):
            vectors[Q, i] += vectors[travel, i]
            vectors[V, i] = vectors[trial, i]
        for c in range(width):
            flat[Q, c] += flat[travel_t, c]
            flat[V, c] = flat[trial_t, c]
        left -= step
    for c in range(width):
        flat[FRICTION, c] = flat[_F_T, c]
    for k in range(of_slopes.shape[1]):
        for d in range(own.shape[2]):
            of_slopes[NOW, k, d] = of_slopes[THEN, k, d]
