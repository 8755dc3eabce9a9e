"""Tangent of a nonlinear step with friction of speed alone; see ``step_tangent``."""

from __future__ import annotations

import numpy as np

from pivident.dynamics.friction_table import friction_torque
from pivident.dynamics.lanes import LANES, load, store
from pivident.foundation.compiled import inner, rows
from pivident.loop.simulation.friction_tangent import (
    friction_block,
    friction_columns,
)
from pivident.loop.simulation.integration import (
    MAX_INNER_STEPS,
    MIDDLE,
    MIDDLE_BIAS,
    NONLINEAR_STIFFNESS,
    PASSED_OVER,
    THEN,
    Q,
    V,
    apply_matrix,
    damping_rate,
    rate_at_reversals,
)
from pivident.loop.simulation.loop_tangent import (
    LENGTH,
    MIDDLE_TANGENT,
    SPEED_BEFORE,
)
from pivident.loop.simulation.rigid_body_tangent import (
    product_row,
)

# Scratch rows of the simulation's ``vectors``.
_A0, _A, _Y, _Z, _W, _AHEAD, _REST, _NET = rows(9, 10, 11, 13, 14, 15, 16, 18)

# Scratch rows of the tangents' ``vectors``; ``freeze_tangent`` has filled the first one.
_NET_T, _A0_T, _A_T, _Y_T, _X_T, _Z_T, _REST_T = rows(11, 12, 13, 14, 15, 16, 19)


@inner
def _stage_tangent(
    term_index, term_value, pair_index, pair_value, vectors, matrices, slopes, torque, f, speed,
    of_speed, out, own, layers, of_slopes, constants, constant_slope, columns, bends,
):  # fmt: skip
    """Tangent of M⁻¹ (τ - h - f(v)) at one stage, friction ``f`` and its slopes known there."""
    friction_columns(
        term_index, term_value, pair_index, pair_value, constants, constant_slope,
        vectors, speed, columns, bends,
    )  # fmt: skip
    n = own.shape[1]
    for i in range(n):
        vectors[_NET, i] = torque[i] - vectors[MIDDLE_BIAS, i] - vectors[f, i]
    for at in range(0, own.shape[2], LANES):
        friction_block(
            pair_index, pair_value, slopes, THEN, columns, bends, own, of_speed, at,
            own, _REST_T, of_slopes, THEN, at,
        )  # fmt: skip
        for i in range(n):
            net = load(own, (_NET_T, i), at) - load(own, (_REST_T, i), at)
            store(own, (_REST_T, i), at, net)
        for i in range(n):
            a = product_row(matrices, vectors, _NET, own, _REST_T, layers, MIDDLE_TANGENT, i, at)
            store(own, (out, i), at, a)


@inner
def nonlinear_tangent(
    linear, term_index, term_value, pair_index, pair_value, vectors, matrices, slopes, torque, h,
    own, layers, times, of_slopes, constants, constant_slope, before, columns, bends, timed,
):  # fmt: skip
    """Carry them over a nonlinear step: Runge–Kutta 4 once more, with its tangents."""
    n = own.shape[1]
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
            v, V, k1_t, own, layers, of_slopes, constants, constant_slope, columns, bends,
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
            for at in range(0, own.shape[2], LANES):
                for i in range(n):
                    speed = load(own, (V, i), at) + (weight * step) * load(own, (last_t, i), at)
                    if timed:
                        speed += (weight * step / h * vectors[last, i]) * load(times, (LENGTH,), at)
                    store(own, (trial_t, i), at, speed)
            _stage_tangent(
                term_index, term_value, pair_index, pair_value, vectors, matrices, slopes, torque,
                f, trial, trial_t, target_t, own, layers, of_slopes, constants, constant_slope,
                columns, bends,
            )  # fmt: skip
            stage += 1
        for i in range(n):
            inside = vectors[k2, i] + vectors[k3, i]
            gained = (vectors[k1, i] + 2.0 * inside + vectors[k4, i]) / 6.0
            travelled = vectors[v, i] + step / 3.0 * (vectors[k1, i] + inside)
            for at in range(0, own.shape[2], LANES):
                first, speed = load(own, (k1_t, i), at), load(own, (V, i), at)
                within = load(own, (k2_t, i), at) + load(own, (k3_t, i), at)
                way = step * (speed + (step / 6.0) * (first + within))
                gain = (step / 6.0) * (first + 2.0 * within + load(own, (k4_t, i), at))
                if timed:
                    longer = (step / h) * load(times, (LENGTH,), at)
                    way += travelled * longer
                    gain += gained * longer
                store(own, (Q, i), at, load(own, (Q, i), at) + way)
                store(own, (V, i), at, speed + gain)
            vectors[v, i] += step * gained
        left -= step
