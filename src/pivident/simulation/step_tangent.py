"""Tangent of one step of the simulation with friction of speed alone; see ``integration``.

The step's own scheme is differentiated, term by term. Of the nonlinear step the lengths of the
inner steps count as fixed shares of the step: they follow the stiffness of friction, and what
another length would change is the error of Runge–Kutta's method.
"""

from __future__ import annotations

import numpy as np

from pivident.compiled import inlined as _inline
from pivident.compiled import inner, rows
from pivident.dynamics.friction_table import friction_torque
from pivident.simulation.friction_tangent import friction_tangent, slope_times_tangent
from pivident.simulation.integration import (
    BIAS,
    CHANGE,
    FRICTION,
    LAST_BIAS,
    MAX_INNER_STEPS,
    MIDDLE,
    MIDDLE_BIAS,
    NONLINEAR_STIFFNESS,
    NOW,
    PASSED_OVER,
    RENEWALS,
    STIFFNESS_PER_STEP,
    THEN,
    Q,
    V,
    apply_matrix,
    damping_rate,
    rate_at_reversals,
    slope_times,
    subtract_product,
)
from pivident.simulation.loop_tangent import (
    CHANGE_TANGENT,
    DELAY,
    DELAYED,
    FRICTION_BEFORE,
    LAST_STEP_BEFORE,
    LAST_TANGENT,
    LENGTH,
    MIDDLE_TANGENT,
    RENEWED_TANGENT,
    SINCE_BEFORE,
    SINCE_TANGENT,
    SLOPE_BEFORE,
    SPEED_BEFORE,
    STILL_TANGENT,
)
from pivident.simulation.row_sums import add_rows_twice

# Scratch rows of the simulation's ``vectors``, as the step that was taken has left them.
_A0, _A, _Y, _Z, _W, _AHEAD, _REST, _NET = rows(9, 10, 11, 13, 14, 15, 16, 18)

# Scratch rows of the tangents' ``vectors``.
_NET_T, _A0_T, _A_T, _Y_T, _X_T, _Z_T, _W_T, _AHEAD_T, _REST_T = rows(
    11, 12, 13, 14, 15, 16, 17, 18, 19
)

#: Row of ``slopes`` that holds those at the start of the step.
(_WAS,) = rows(2)


@_inline
def product_tangent(matrices, vectors, x, own, layers, of_x, scale, rate, times, base, out):
    """Tangent of base - scale · M⁻¹ x, M⁻¹ that of the middle: rows of ``own``.

    ``rate``: change of ``scale`` with the length of the step, zero where no direction has one.
    """
    n, directions = own.shape[1], own.shape[2]
    for i in range(n):
        inverse, row = (MIDDLE * n + i) * n, out * n + i
        add_rows_twice(
            own, row, own, base * n + i, -scale, n,
            matrices, inverse, own, of_x * n, 1,
            vectors, x * n, layers, (MIDDLE_TANGENT * n + i) * n, 1,
        )  # fmt: skip
        if rate != 0.0:
            moved = 0.0
            for j in range(n):
                moved += rate * matrices[MIDDLE, i, j] * vectors[x, j]
            for d in range(directions):
                own[out, i, d] -= moved * times[LENGTH, d]


@_inline
def freeze_tangent(
    vectors, matrices, slopes, clock, h, share, which, own, flat, layers, flat_layers, times,
    flat_commanded, before, old,
):  # fmt: skip
    """Tangents of the length of the step, of τ - h and of M⁻¹ in its middle.

    ``share``: change of the step's length with the drive's delay; ``which``: row of the torque in
    ``commanded``. The friction of the step is not yet in what ``_NET_T`` receives.
    """
    n, directions = own.shape[1], own.shape[2]
    for k in range(before.shape[1]):
        slopes[_WAS, k] = before[SLOPE_BEFORE, k]
    last = old[LAST_STEP_BEFORE]
    weight = 0.0 if clock[RENEWALS] < 2.0 else 0.5 * (h / last)
    for c in range(flat.shape[1]):
        change = flat[BIAS, c] - flat[LAST_BIAS, c]
        flat[_NET_T, c] = flat_commanded[which, c] - flat[BIAS, c] - weight * change
    middle = old[SINCE_BEFORE] + 0.5 * h
    for c in range(flat_layers.shape[1]):
        flat_layers[MIDDLE_TANGENT, c] = (
            flat_layers[RENEWED_TANGENT, c] + middle * flat_layers[CHANGE_TANGENT, c]
        )
    if old[DELAYED] == 0.0:
        return
    for d in range(directions):
        times[LENGTH, d] = share * times[DELAY, d]
    for i in range(n):
        if weight > 0.0:
            change = vectors[BIAS, i] - vectors[LAST_BIAS, i]
            for d in range(directions):
                stretch = times[LENGTH, d] / h - times[LAST_TANGENT, d] / last
                own[_NET_T, i, d] -= weight * stretch * change
        for j in range(n):
            change = matrices[CHANGE, i, j]
            for d in range(directions):
                layers[MIDDLE_TANGENT, i, j, d] += change * (
                    times[SINCE_TANGENT, d] + 0.5 * times[LENGTH, d]
                )
    for d in range(directions):
        times[SINCE_TANGENT, d] += times[LENGTH, d]
        times[LAST_TANGENT, d] = times[LENGTH, d]


@_inline
def linear_tangent(
    term_index, term_value, pair_index, pair_value, vectors, matrices, slopes, torque, h, timed,
    own, flat, layers, times, of_slopes, constants, constant_slope, before, curvature,
):  # fmt: skip
    """Carry the tangents over the linear step that ``integration.advance`` has just taken.

    ``timed``: whether a direction changes the length of the step.
    """
    n, directions, width = own.shape[1], own.shape[2], flat.shape[1]
    for i in range(n):
        vectors[_NET, i] = torque[i] - vectors[MIDDLE_BIAS, i] - before[FRICTION_BEFORE, i]
    for c in range(width):
        flat[_NET_T, c] -= flat[FRICTION, c]
    product_tangent(
        matrices, vectors, _NET, own, layers, _NET_T, -1.0, 0.0, times, STILL_TANGENT, _A0_T
    )
    _taylor_tangent(
        pair_index, pair_value, vectors, matrices, slopes, h, timed, own, flat, layers, of_slopes,
        times, before,
    )  # fmt: skip
    slope_times_tangent(
        pair_index, pair_value, slopes, _WAS, of_slopes, NOW, vectors, _Y, own, _Y_T, _Z_T
    )
    for c in range(width):
        flat[_AHEAD_T, c] = flat[V, c] + flat[_Y_T, c]
    friction_tangent(
        term_index, term_value, pair_index, pair_value, constants, constant_slope,
        vectors, _AHEAD, slopes, THEN, own, _AHEAD_T, _W_T, of_slopes, THEN, curvature,
    )  # fmt: skip
    for c in range(width):
        flat[_REST_T, c] = flat[_W_T, c] - flat[FRICTION, c] - flat[_Z_T, c]
    product_tangent(
        matrices, vectors, _REST, own, layers, _REST_T, h / 3.0, 1.0 / 3.0 if timed else 0.0, times,
        _AHEAD_T, V,
    )  # fmt: skip
    for c in range(width):
        flat[_A_T, c] = flat[V, c] - flat[_AHEAD_T, c]
        flat[Q, c] += flat[_X_T, c] + 0.25 * h * flat[_A_T, c]
    for i in range(n):
        vectors[_A, i] = vectors[V, i] - vectors[_AHEAD, i]
        if timed:
            for d in range(directions):
                own[Q, i, d] += 0.25 * times[LENGTH, d] * vectors[_A, i]
    slope_times_tangent(
        pair_index, pair_value, slopes, THEN, of_slopes, THEN, vectors, _A, own, _A_T, _Z_T
    )
    for c in range(width):
        flat[FRICTION, c] = flat[_W_T, c] + flat[_Z_T, c]
    for k in range(n + pair_index.shape[0]):
        for d in range(directions):
            of_slopes[NOW, k, d] = of_slopes[THEN, k, d]


@_inline
def _taylor_tangent(
    pair_index, pair_value, vectors, matrices, slopes, h, timed, own, flat, layers, of_slopes,
    times, before,
):  # fmt: skip
    """Tangents of the changes y of speed and x of position, by the polynomial of the step."""
    n, directions, width = own.shape[1], own.shape[2], flat.shape[1]
    stiffness = damping_rate(pair_index, pair_value, matrices, slopes, _WAS)
    count = int(np.ceil(min(max(stiffness * h / STIFFNESS_PER_STEP, 1e-3), MAX_INNER_STEPS)))
    step = h / count
    for i in range(n):
        vectors[_Y, i], vectors[_A, i] = 0.0, vectors[_A0, i]
    for c in range(width):
        flat[_Y_T, c], flat[_X_T, c] = 0.0, 0.0
    of_a = _A0_T
    for s in range(count):
        for i in range(n):
            vectors[_W, i] = vectors[_A, i]
        of_w = of_a
        for order in range(4, 1, -1):
            slope_times(pair_index, pair_value, slopes, _WAS, vectors, _W, _Z)
            slope_times_tangent(
                pair_index, pair_value, slopes, _WAS, of_slopes, NOW, vectors, _W, own, of_w, _Z_T
            )
            product_tangent(
                matrices, vectors, _Z, own, layers, _Z_T, step / order,
                1.0 / (order * count) if timed else 0.0, times, of_a, _W_T,
            )  # fmt: skip
            of_w = _W_T
            subtract_product(matrices, vectors, _Z, step / order, _A, _W)
            if order == 3:
                for c in range(width):
                    flat[_X_T, c] += step * (
                        flat[V, c] + flat[_Y_T, c] + 0.5 * step * flat[_W_T, c]
                    )
                for i in range(n if timed else 0):
                    speed = before[SPEED_BEFORE, i] + vectors[_Y, i] + step * vectors[_W, i]
                    for d in range(directions):
                        own[_X_T, i, d] += times[LENGTH, d] / count * speed
        for c in range(width):
            flat[_Y_T, c] += step * flat[_W_T, c]
        for i in range(n):
            if timed:
                for d in range(directions):
                    own[_Y_T, i, d] += times[LENGTH, d] / count * vectors[_W, i]
            vectors[_Y, i] += step * vectors[_W, i]
        if s < count - 1:
            slope_times(pair_index, pair_value, slopes, _WAS, vectors, _Y, _Z)
            slope_times_tangent(
                pair_index, pair_value, slopes, _WAS, of_slopes, NOW, vectors, _Y, own, _Y_T, _Z_T
            )
            product_tangent(matrices, vectors, _Z, own, layers, _Z_T, 1.0, 0.0, times, _A0_T, _A_T)
            subtract_product(matrices, vectors, _Z, 1.0, _A0, _A)
            of_a = _A_T


@inner
def _stage_tangent(
    term_index, term_value, pair_index, pair_value, vectors, matrices, slopes, torque, f, speed,
    of_speed, out, own, flat, layers, times, of_slopes, constants, constant_slope, curvature,
):  # fmt: skip
    """Tangent of M⁻¹ (τ - h - f(v)) at one stage, friction ``f`` and its slopes known there."""
    friction_tangent(
        term_index, term_value, pair_index, pair_value, constants, constant_slope,
        vectors, speed, slopes, THEN, own, of_speed, _REST_T, of_slopes, THEN, curvature,
    )  # fmt: skip
    for i in range(own.shape[1]):
        vectors[_NET, i] = torque[i] - vectors[MIDDLE_BIAS, i] - vectors[f, i]
    for c in range(flat.shape[1]):
        flat[_REST_T, c] = flat[_NET_T, c] - flat[_REST_T, c]
    product_tangent(
        matrices, vectors, _NET, own, layers, _REST_T, -1.0, 0.0, times,
        STILL_TANGENT, out,
    )  # fmt: skip


@inner
def nonlinear_tangent(
    linear, term_index, term_value, pair_index, pair_value, vectors, matrices, slopes, torque, h,
    own, flat, layers, times, of_slopes, constants, constant_slope, before, curvature, timed,
):  # fmt: skip
    """Carry them over a nonlinear step: Runge–Kutta 4 once more, with its tangents."""
    n, directions, width = own.shape[1], own.shape[2], flat.shape[1]
    k1, k2, k3, k4, trial, f, v = _A0, _A, _Y, _REST, _Z, _W, _AHEAD
    k1_t, k2_t, k3_t, k4_t, trial_t = _A0_T, _A_T, _Y_T, _X_T, _Z_T
    for i in range(n):
        vectors[v, i] = before[SPEED_BEFORE, i]
    left, shortest = h, h / MAX_INNER_STEPS
    while left > 1e-9 * h:
        friction_torque(
            linear, term_index, term_value, pair_index, pair_value, vectors, v, f, slopes, THEN
        )
        stiffness = damping_rate(pair_index, pair_value, matrices, slopes, THEN)
        step = left / np.ceil(max(stiffness * left / NONLINEAR_STIFFNESS, 1e-3))
        step = min(max(step, shortest), left)
        apply_matrix(matrices, MIDDLE, vectors, torque, MIDDLE_BIAS, f, k1)
        _stage_tangent(
            term_index, term_value, pair_index, pair_value, vectors, matrices, slopes, torque, f,
            v, V, k1_t, own, flat, layers, times, of_slopes, constants, constant_slope, curvature,
        )  # fmt: skip
        stage = 1
        while stage < 4:
            last = k1 if stage == 1 else (k2 if stage == 2 else k3)
            last_t = k1_t if stage == 1 else (k2_t if stage == 2 else k3_t)
            weight = 1.0 if stage == 3 else 0.5
            for i in range(n):
                vectors[trial, i] = vectors[v, i] + weight * step * vectors[last, i]
            friction_torque(
                linear, term_index, term_value, pair_index, pair_value, vectors, trial, f, slopes,
                THEN,
            )  # fmt: skip
            ahead = damping_rate(pair_index, pair_value, matrices, slopes, THEN)
            turning = rate_at_reversals(pair_index, pair_value, matrices, slopes, vectors, v, trial)
            if turning * step > PASSED_OVER:
                ahead = max(ahead, turning)
            if ahead * step > 1.5 * NONLINEAR_STIFFNESS and step > shortest:
                step = max(NONLINEAR_STIFFNESS / ahead, shortest)
                stage = 1
                continue
            target = k2 if stage == 1 else (k3 if stage == 2 else k4)
            target_t = k2_t if stage == 1 else (k3_t if stage == 2 else k4_t)
            apply_matrix(matrices, MIDDLE, vectors, torque, MIDDLE_BIAS, f, target)
            for c in range(width):
                flat[trial_t, c] = flat[V, c] + weight * step * flat[last_t, c]
            for i in range(n if timed else 0):
                longer = weight * step / h * vectors[last, i]
                for d in range(directions):
                    own[trial_t, i, d] += longer * times[LENGTH, d]
            _stage_tangent(
                term_index, term_value, pair_index, pair_value, vectors, matrices, slopes, torque,
                f, trial, trial_t, target_t, own, flat, layers, times, of_slopes, constants,
                constant_slope, curvature,
            )  # fmt: skip
            stage += 1
        for c in range(width):
            within = flat[k2_t, c] + flat[k3_t, c]
            flat[Q, c] += step * (flat[V, c] + step / 6.0 * (flat[k1_t, c] + within))
            flat[V, c] += step / 6.0 * (flat[k1_t, c] + 2.0 * within + flat[k4_t, c])
        for i in range(n):
            inside = vectors[k2, i] + vectors[k3, i]
            gained = (vectors[k1, i] + 2.0 * inside + vectors[k4, i]) / 6.0
            travelled = vectors[v, i] + step / 3.0 * (vectors[k1, i] + inside)
            if timed:
                for d in range(directions):
                    own[Q, i, d] += step / h * times[LENGTH, d] * travelled
                    own[V, i, d] += step / h * times[LENGTH, d] * gained
            vectors[v, i] += step * gained
        left -= step
