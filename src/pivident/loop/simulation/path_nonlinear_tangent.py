"""Tangent of a nonlinear step with friction of position and path; ``path_integration``."""

from __future__ import annotations

import numpy as np

from pivident.dynamics.friction_table import (
    AHEAD,
)
from pivident.foundation.compiled import inner, rows
from pivident.loop.simulation.integration import (
    FRICTION,
    MAX_INNER_STEPS,
    MIDDLE,
    MIDDLE_BIAS,
    NONLINEAR_STIFFNESS,
    NOW,
    THEN,
    Q,
    V,
    apply_matrix,
)
from pivident.loop.simulation.loop_tangent import LENGTH, STILL_TANGENT
from pivident.loop.simulation.path_friction_tangent import (
    FREE_TANGENT,
    NET,
    accept_tangent,
    friction_after_tangent,
    lengthen,
    net_tangent,
)
from pivident.loop.simulation.path_integration import (
    NONLINEAR_OSCILLATION,
    inner_steps,
    path_stiffness,
    rate_at_reversals,
)
from pivident.loop.simulation.rigid_body_tangent import product_tangent

# Scratch rows of the copy of the simulation's ``vectors``: the stages' accelerations, the speed and
# the travel that are tried, and friction and net torque there.
_A0, _A, _Y, _X, _Z, _W, _T = rows(9, 10, 11, 12, 13, 14, 18)

# Scratch rows of the tangents' ``vectors``.
_A0_T, _A_T, _Y_T, _X_T, _Z_T, _T_T, _F_T = rows(12, 13, 14, 15, 16, 20, 26)


@inner
def nonlinear_path_tangent(
    linear, term_index, term_value, pair_index, pair_value, path_index, path_value, path,
    vectors, matrices, slopes, torque, h,
    own, flat, layers, times, of_slopes, of_path, constants, constant_slope, columns, bends,
    partials,
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
        net_tangent(vectors, torque, f, own, flat, _F_T)
        apply_matrix(matrices, MIDDLE, vectors, torque, MIDDLE_BIAS, f, k1)
        product_tangent(
            matrices, vectors, NET, own, layers, FREE_TANGENT, -1.0, 0.0, times, STILL_TANGENT, k1_t
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
            lengthen(own, times, travel_t, vectors, V if stage == 1 else trial, longer)
            lengthen(own, times, trial_t, vectors, last, longer)
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
            net_tangent(vectors, torque, f, own, flat, _F_T)
            apply_matrix(matrices, MIDDLE, vectors, torque, MIDDLE_BIAS, f, target)
            product_tangent(
                matrices, vectors, NET, own, layers, FREE_TANGENT, -1.0, 0.0, times, STILL_TANGENT,
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
        accept_tangent(path, of_path)
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
