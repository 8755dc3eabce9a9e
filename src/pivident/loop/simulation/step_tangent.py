"""Tangent of one step of the simulation with friction of speed alone; see ``integration``.

The step's own scheme is differentiated, term by term. Of the nonlinear step the lengths of the
inner steps count as fixed shares of the step: they follow the stiffness of friction, and what
another length would change is the error of Runge–Kutta's method.

Almost every step is linear. There all that does not depend on the direction is computed first, and
a block of directions is then carried through the whole step, while its numbers are at hand.
"""

from __future__ import annotations

import numpy as np

from pivident.dynamics.lanes import LANES, load, nothing, store
from pivident.foundation.compiled import inlined as _inline, inner, rows
from pivident.loop.simulation.friction_tangent import (
    friction_block,
    friction_columns,
    slope_times_block,
)
from pivident.loop.simulation.integration import (
    BIAS,
    FRICTION,
    LAST_BIAS,
    MAX_INNER_STEPS,
    MIDDLE_BIAS,
    NOW,
    RENEWALS,
    STIFFNESS_PER_STEP,
    THEN,
    Q,
    V,
    damping_rate,
    slope_times,
    subtract_product,
)
from pivident.loop.simulation.loop_tangent import (
    DELAY,
    DELAYED,
    FRICTION_BEFORE,
    LAST_STEP_BEFORE,
    LAST_TANGENT,
    LENGTH,
    MIDDLE_TANGENT,
    SINCE_BEFORE,
    SINCE_TANGENT,
    SLOPE_BEFORE,
    SPEED_BEFORE,
)
from pivident.loop.simulation.rigid_body_tangent import (
    middle_block,
    moved_by,
    product_row,
)

# Scratch rows of the simulation's ``vectors``, as the step that was taken has left them …
_A0, _A, _Y, _Z, _W, _AHEAD, _REST = rows(9, 10, 11, 13, 14, 15, 16)

# … and more: y at the end of an inner step, the speed that its end is corrected by, the net torque,
# Horner's a, w₃, w₂ and w₁, and D a, D w₃ and D w₂.
_NEXT, _GAIN, _NET, _STAGE, _BRAKED = rows(12, 14, 18, 19, 23)

# Scratch rows of the tangents' ``vectors``.
_NET_T, _A0_T, _A_T, _Y_T, _X_T, _Z_T, _REST_T = rows(11, 12, 13, 14, 15, 16, 19)

# Rows of ``block``, scratch of one block of directions, shape (BLOCK_ROWS, joints, LANES).
_B_A, _B_W, _B_Z, _B_Y, _B_X, _B_F, _B_AHEAD, _B_NET = rows(0, 1, 2, 3, 4, 5, 6, 7)
BLOCK_ROWS = 8

#: Layer of ``matrix_block`` that receives δM⁻¹ in the middle of the step.
(_MIDDLE_BLOCK,) = rows(0)

#: Row of ``slopes`` that holds those at the start of the step.
(_WAS,) = rows(2)


@_inline
def length_tangent(times, share, old):
    """Tangent of the step's length; ``share``: its change with the drive's delay."""
    if old[DELAYED] != 0.0:
        for d in range(times.shape[1]):
            times[LENGTH, d] = share * times[DELAY, d]


@_inline
def _bias_weight(clock, h, old):
    """Weight of the last change of h in the middle of the step."""
    return 0.0 if clock[RENEWALS] < 2.0 else 0.5 * (h / old[LAST_STEP_BEFORE])


@_inline
def _net_row(vectors, own, commanded, which, times, old, weight, h, i, at):
    """Tangent of τ - h in the middle of the step of one joint; friction is not yet in it."""
    bias = load(own, (BIAS, i), at)
    change = bias - load(own, (LAST_BIAS, i), at)
    net = load(commanded, (which, i), at) - bias - weight * change
    if old[DELAYED] != 0.0 and weight > 0.0:
        stretch = (1.0 / h) * load(times, (LENGTH,), at)
        stretch -= (1.0 / old[LAST_STEP_BEFORE]) * load(times, (LAST_TANGENT,), at)
        net -= weight * (vectors[BIAS, i] - vectors[LAST_BIAS, i]) * stretch
    return net


@_inline
def _pass_time(times, old, at):
    """Add the length of the step to the time since M⁻¹ was computed; the step is the last one."""
    if old[DELAYED] != 0.0:
        length = load(times, (LENGTH,), at)
        store(times, (SINCE_TANGENT,), at, load(times, (SINCE_TANGENT,), at) + length)
        store(times, (LAST_TANGENT,), at, length)


@inner
def freeze_tangent(vectors, matrices, clock, h, which, own, layers, times, commanded, old):
    """Tangents of τ - h and of M⁻¹ in the middle of the step, for all directions.

    ``which``: row of the torque in ``commanded``. The friction of the step is not yet in what
    ``_NET_T`` receives.
    """
    weight, middle = _bias_weight(clock, h, old), old[SINCE_BEFORE] + 0.5 * h
    timed = old[DELAYED] != 0.0
    for at in range(0, own.shape[2], LANES):
        for i in range(own.shape[1]):
            net = _net_row(vectors, own, commanded, which, times, old, weight, h, i, at)
            store(own, (_NET_T, i), at, net)
        middle_block(matrices, layers, times, middle, timed, layers, MIDDLE_TANGENT, at, at)
        _pass_time(times, old, at)


@_inline
def linear_tangent(
    term_index, term_value, pair_index, pair_value, vectors, matrices, slopes, clock, torque, h,
    which, own, layers, times, of_slopes, commanded, constants, constant_slope, before, old,
    columns, bends, block, matrix_block,
):  # fmt: skip
    """Carry the tangents over the linear step that ``integration.advance`` has just taken.

    ``which``: row of the torque in ``commanded``; ``columns bends``: see ``friction_columns``;
    ``block matrix_block``: scratch of a block of directions.
    """
    n, slope_rows = own.shape[1], own.shape[1] + pair_index.shape[0]
    friction_columns(
        term_index, term_value, pair_index, pair_value, constants, constant_slope,
        vectors, _AHEAD, columns, bends,
    )  # fmt: skip
    for k in range(slope_rows):
        slopes[_WAS, k] = before[SLOPE_BEFORE, k]
    for i in range(n):
        vectors[_NET, i] = torque[i] - vectors[MIDDLE_BIAS, i] - before[FRICTION_BEFORE, i]
        vectors[_Y, i], vectors[_STAGE, i] = 0.0, vectors[_A0, i]
        vectors[_GAIN, i] = vectors[V, i] - vectors[_AHEAD, i]
    stiffness = damping_rate(pair_index, pair_value, matrices, slopes, _WAS)
    count = int(np.ceil(min(max(stiffness * h / STIFFNESS_PER_STEP, 1e-3), MAX_INNER_STEPS)))
    step, weight, middle = h / count, _bias_weight(clock, h, old), old[SINCE_BEFORE] + 0.5 * h
    timed = old[DELAYED] != 0.0
    for s in range(count):
        _horner_stages(pair_index, pair_value, vectors, matrices, slopes, step)
        for at in range(0, own.shape[2], LANES):
            middle_block(
                matrices, layers, times, middle, timed, matrix_block, _MIDDLE_BLOCK, None, at
            )
            if s == 0:
                for i in range(n):
                    net = _net_row(vectors, own, commanded, which, times, old, weight, h, i, at)
                    store(block, (_B_NET, i), None, net - load(own, (FRICTION, i), at))
                    store(block, (_B_Y, i), None, nothing())
                    store(block, (_B_X, i), None, nothing())
                for i in range(n):
                    a = product_row(
                        matrices, vectors, _NET, block, _B_NET, matrix_block, _MIDDLE_BLOCK, i, None
                    )
                    store(block, (_B_A, i), None, a)
                    store(own, (_A0_T, i), at, a)
            else:
                for i in range(n):
                    store(block, (_B_A, i), None, load(own, (_A_T, i), at))
                    store(block, (_B_Y, i), None, load(own, (_Y_T, i), at))
                    store(block, (_B_X, i), None, load(own, (_X_T, i), at))
            _taylor_block(
                pair_index, pair_value, vectors, matrices, slopes, step, count, timed, own,
                of_slopes, times, before, block, matrix_block, at,
            )  # fmt: skip
            # D y, for the next inner step, or for the correction
            slope_times_block(
                pair_index, pair_value, slopes, _WAS, of_slopes, NOW, vectors, _NEXT,
                block, _B_Y, _B_Z, None, at,
            )  # fmt: skip
            if s < count - 1:
                for i in range(n):
                    product = product_row(
                        matrices, vectors, _Z, block, _B_Z, matrix_block, _MIDDLE_BLOCK, i, None
                    )
                    store(own, (_A_T, i), at, load(own, (_A0_T, i), at) - product)
                    store(own, (_Y_T, i), at, load(block, (_B_Y, i), None))
                    store(own, (_X_T, i), at, load(block, (_B_X, i), None))
            else:
                _corrected_block(
                    pair_index, pair_value, vectors, matrices, slopes, h, timed, own, of_slopes,
                    times, columns, bends, block, matrix_block, at,
                )  # fmt: skip
                _pass_time(times, old, at)
        for i in range(n):
            vectors[_Y, i] = vectors[_NEXT, i]
        subtract_product(matrices, vectors, _Z, 1.0, _A0, _STAGE)


@_inline
def _horner_stages(pair_index, pair_value, vectors, matrices, slopes, step):
    """The stages of an inner step and D times each, y at its end, and D y."""
    for m in range(3):
        slope_times(pair_index, pair_value, slopes, _WAS, vectors, _STAGE + m, _BRAKED + m)
        subtract_product(matrices, vectors, _BRAKED + m, step / (4 - m), _STAGE, _STAGE + m + 1)
    for i in range(vectors.shape[1]):
        vectors[_NEXT, i] = vectors[_Y, i] + step * vectors[_STAGE + 3, i]
    slope_times(pair_index, pair_value, slopes, _WAS, vectors, _NEXT, _Z)


@_inline
def _taylor_block(
    pair_index, pair_value, vectors, matrices, slopes, step, count, timed, own, of_slopes, times,
    before, block, matrix_block, at,
):  # fmt: skip
    """Tangents of the changes y of speed and x of position, by the polynomial of the step."""
    n, length = own.shape[1], load(times, (LENGTH,), at)
    for m in range(3):
        slope_times_block(
            pair_index, pair_value, slopes, _WAS, of_slopes, NOW, vectors, _STAGE + m,
            block, _B_A if m == 0 else _B_W, _B_Z, None, at,
        )  # fmt: skip
        part = step / (4 - m)
        for i in range(n):
            product = product_row(
                matrices, vectors, _BRAKED + m, block, _B_Z, matrix_block, _MIDDLE_BLOCK, i, None
            )
            w = load(block, (_B_A, i), None) - part * product
            if timed:
                moved = moved_by(matrices, vectors, _BRAKED + m, i)
                w -= (moved / ((4 - m) * count)) * length
            store(block, (_B_W, i), None, w)
            if m == 1:
                speed = load(own, (V, i), at) + load(block, (_B_Y, i), None) + (0.5 * step) * w
                x = load(block, (_B_X, i), None) + step * speed
                if timed:
                    way = before[SPEED_BEFORE, i] + vectors[_Y, i]
                    x += ((way + step * vectors[_STAGE + 2, i]) / count) * length
                store(block, (_B_X, i), None, x)
    for i in range(n):
        y = load(block, (_B_Y, i), None) + step * load(block, (_B_W, i), None)
        if timed:
            y += (vectors[_STAGE + 3, i] / count) * length
        store(block, (_B_Y, i), None, y)


@_inline
def _corrected_block(
    pair_index, pair_value, vectors, matrices, slopes, h, timed, own, of_slopes, times,
    columns, bends, block, matrix_block, at,
):  # fmt: skip
    """Tangents of state and friction at the end of the step, corrected by what D y misses."""
    n, length = own.shape[1], load(times, (LENGTH,), at)
    for i in range(n):
        store(block, (_B_AHEAD, i), None, load(own, (V, i), at) + load(block, (_B_Y, i), None))
    friction_block(
        pair_index, pair_value, slopes, THEN, columns, bends, block, _B_AHEAD, None,
        block, _B_F, of_slopes, THEN, at,
    )  # fmt: skip
    for i in range(n):
        rest = load(block, (_B_F, i), None) - load(own, (FRICTION, i), at)
        store(block, (_B_W, i), None, rest - load(block, (_B_Z, i), None))
    for i in range(n):
        gain = (-h / 3.0) * product_row(
            matrices, vectors, _REST, block, _B_W, matrix_block, _MIDDLE_BLOCK, i, None
        )
        way = load(own, (Q, i), at) + load(block, (_B_X, i), None)
        if timed:
            gain -= (moved_by(matrices, vectors, _REST, i) / 3.0) * length
            way += (0.25 * vectors[_GAIN, i]) * length
        store(block, (_B_A, i), None, gain)
        store(own, (V, i), at, load(block, (_B_AHEAD, i), None) + gain)
        store(own, (Q, i), at, way + (0.25 * h) * gain)
    slope_times_block(
        pair_index, pair_value, slopes, THEN, of_slopes, THEN, vectors, _GAIN,
        block, _B_A, _B_Z, None, at,
    )  # fmt: skip
    for i in range(n):
        store(own, (FRICTION, i), at, load(block, (_B_F, i), None) + load(block, (_B_Z, i), None))
    for k in range(n + pair_index.shape[0]):
        store(of_slopes, (NOW, k), at, load(of_slopes, (THEN, k), at))
