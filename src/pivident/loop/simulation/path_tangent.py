"""Tangent of one step of the simulation with friction of position and path; ``path_integration``.

The step is taken once more, on copies of the state before it, with its tangents beside it. As with
friction of speed alone, what the scheme decides stays as it is: the rule that is used, the count of
inner steps and their shares of the step.
"""

from __future__ import annotations

import numpy as np

from pivident.dynamics.friction_table import (
    AHEAD,
    MIDWAY,
    RATE,
)
from pivident.foundation.compiled import inner, rows
from pivident.loop.simulation.integration import (
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
from pivident.loop.simulation.loop_tangent import STILL_TANGENT
from pivident.loop.simulation.path_friction_tangent import (
    FREE_TANGENT,
    NET,
    accept_tangent,
    change_tangent,
    friction_after_tangent,
    lengthen,
    net_tangent,
)
from pivident.loop.simulation.path_integration import (
    OSCILLATION_PER_STEP,
    SIMPSON_DIFFERENCE,
    SIMPSON_FEEDBACK,
    change,
    inner_steps,
    path_stiffness,
    rate_at_reversals,
)
from pivident.loop.simulation.path_nonlinear_tangent import nonlinear_path_tangent
from pivident.loop.simulation.rigid_body_tangent import product_tangent

# Scratch rows of the copy of the simulation's ``vectors``, as in ``path_integration``.
_A0, _A, _Y, _X, _Z, _W, _AHEAD, _REST = rows(9, 10, 11, 12, 13, 14, 15, 16)
_T, _MIDWAY_SPEED, _MIDWAY_TRAVEL, _MIDWAY_REST, _DX = rows(18, 19, 20, 21, 22)

# Scratch rows of the tangents' ``vectors``.
_A0_T, _A_T, _Y_T, _X_T, _Z_T, _W_T, _AHEAD_T, _REST_T = rows(12, 13, 14, 15, 16, 17, 18, 19)
_T_T, _MIDWAY_SPEED_T, _MIDWAY_TRAVEL_T, _MIDWAY_REST_T, _DX_T, _F_T = rows(20, 21, 22, 24, 25, 26)

#: Row of ``slopes`` midway.
(_BETWEEN,) = rows(2)


@inner
def path_step_tangent(
    linear, term_index, term_value, pair_index, pair_value, path_index, path_value, path,
    vectors, matrices, slopes, torque, h,
    own, flat, layers, times, of_slopes, of_path, constants, constant_slope, columns, bends,
    partials,
):  # fmt: skip
    """Carry the tangents over the step that ``advance_on_path`` has taken.

    ``path vectors slopes``: copies of the state before the step; τ - h of its middle is in the row
    NET_TANGENT, see ``step_tangent.freeze_tangent``.
    """
    n, width = own.shape[1], flat.shape[1]
    net_tangent(vectors, torque, FRICTION, own, flat, FRICTION)
    apply_matrix(matrices, MIDDLE, vectors, torque, MIDDLE_BIAS, FRICTION, _A0)
    product_tangent(
        matrices, vectors, NET, own, layers, FREE_TANGENT, -1.0, 0.0, times, STILL_TANGENT, _A0_T
    )
    feedback = _linear_tangent(
        pair_index, pair_value, vectors, matrices, slopes, h, own, flat, layers, of_slopes, times
    )
    change(pair_index, pair_value, slopes, NOW, vectors, _Y, _X, _Z)
    change_tangent(
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
        nonlinear_path_tangent(
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
        lengthen(own, times, _DX_T, vectors, _DX, 1.0)
        for i in range(n):
            vectors[_DX, i] = 0.25 * h * (vectors[V, i] - vectors[_AHEAD, i])
    for i in range(n):
        vectors[_A, i] = vectors[V, i] - vectors[_AHEAD, i]
    for c in range(width):
        flat[_A_T, c] = flat[V, c] - flat[_AHEAD_T, c]
        flat[Q, c] += flat[_X_T, c] + flat[_DX_T, c]
    change_tangent(
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
    accept_tangent(path, of_path)
    for k in range(of_slopes.shape[1]):
        for d in range(own.shape[2]):
            of_slopes[NOW, k, d] = of_slopes[THEN, k, d]


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
        lengthen(own, times, _W_T, vectors, _A, longer)
        lengthen(own, times, _T_T, vectors, V, longer)
        lengthen(own, times, _T_T, vectors, _Y, longer)
        for i in range(n):
            vectors[_Y, i] += vectors[_W, i]
            vectors[_X, i] += vectors[_T, i]
        for c in range(width):
            flat[_Y_T, c] += flat[_W_T, c]
            flat[_X_T, c] += flat[_T_T, c]
        for order in range(2, 5):
            part = step / order
            change(pair_index, pair_value, slopes, NOW, vectors, _W, _T, _Z)
            change_tangent(
                pair_index, pair_value, slopes, NOW, of_slopes, vectors, _W, _T, own, _W_T, _T_T,
                _Z_T,
            )  # fmt: skip
            for c in range(width):
                flat[_T_T, c] = part * flat[_W_T, c]
            lengthen(own, times, _T_T, vectors, _W, longer / order)
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
        lengthen(own, times, _X_T, vectors, _W, 0.2 * longer)
        for i in range(n):
            vectors[_X, i] += 0.2 * step * vectors[_W, i]
        if s < count - 1:
            change(pair_index, pair_value, slopes, NOW, vectors, _Y, _X, _Z)
            change_tangent(
                pair_index, pair_value, slopes, NOW, of_slopes, vectors, _Y, _X, own, _Y_T, _X_T,
                _Z_T,
            )  # fmt: skip
            product_tangent(matrices, vectors, _Z, own, layers, _Z_T, 1.0, 0.0, times, _A0_T, _A_T)
            subtract_product(matrices, vectors, _Z, 1.0, _A0, _A)
    return rate * h + square * h * h


@inner
def _simpson_tangent(
    linear, term_index, term_value, pair_index, pair_value, path_index, path_value, path,
    vectors, slopes, matrices, torque, h, feedback,
    own, flat, layers, times, of_slopes, of_path, constants, constant_slope, columns, bends,
    partials,
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
    lengthen(own, times, _MIDWAY_TRAVEL_T, vectors, _Y, -0.125)
    friction_after_tangent(
        linear, term_index, term_value, pair_index, pair_value, path_index, path_value, path,
        MIDWAY, vectors, slopes, _BETWEEN, torque, 0.5 * h, 0.5,
        _MIDWAY_TRAVEL, _MIDWAY_SPEED, _MIDWAY_REST,
        own, _MIDWAY_TRAVEL_T, _MIDWAY_SPEED_T, _MIDWAY_REST_T, of_slopes, of_path, times,
        constants, constant_slope, columns, bends, partials,
    )  # fmt: skip
    change(pair_index, pair_value, slopes, NOW, vectors, _W, _MIDWAY_TRAVEL, _T)
    change_tangent(
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
