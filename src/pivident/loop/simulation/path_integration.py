"""One sampling period under friction of position, path or load as well as of speed.

As in ``integration`` the rigid body is frozen at the middle of the step. Within it friction is a
function F(x, v) of the travel x and the speed v (``friction_kernels``), so that

    dx/dt = v,   dv/dt = M⁻¹ (τ - h - F(x, v))

*linear step*, almost always: D = ∂F/∂v and K = ∂F/∂x at its start give dy/dt = a - M⁻¹ (D y + K x),
y = v - v₀, integrated by Taylor's polynomial of fourth order. What it misses,
r = F(x, v) - F₀ - D y - K x, grows like t²: its integral is (h/3) M⁻¹ r(h).

*Simpson step*, where that rule could miss something: r is evaluated at half the step as well.

*nonlinear step*, at a passage through standstill, or where an element begins to slip: Runge–Kutta 4
on x and v. States keep their exact solution between its stages.
"""

from __future__ import annotations

import numpy as np

from pivident.dynamics.friction_table import (
    AHEAD,
    MIDWAY,
    RATE,
    accept_states,
    friction_torque,
    path_torque,
)
from pivident.foundation.compiled import inlined as _inline, inner, rows, section
from pivident.loop.simulation.integration import (
    FRICTION,
    FRICTION_KNOWN,
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
    damping_rate,
    freeze_at_middle,
    rate_at_reversals,
    slope_times,
    subtract_product,
)
from pivident.robot.friction_terms.coulomb import LOAD

#: Largest √‖M⁻¹K‖·h of an inner step: of the linear one …
OSCILLATION_PER_STEP = 0.5

#: … and of the nonlinear one.
NONLINEAR_OSCILLATION = 0.3

#: Difference of Simpson's rule from the simple one that is accepted, relative to the joint's dry
#: friction. Simpson's own error is many times smaller where friction is smooth.
SIMPSON_DIFFERENCE = 2e-4

#: Remainder times ‖M⁻¹D‖·h + ‖M⁻¹K‖·h² that is accepted there: what the remainder changes in speed
#: and travel meanwhile changes friction again, and no rule for its integral knows of that.
SIMPSON_FEEDBACK = 2e-4

# Rows of ``vectors``; the others of ``integration`` are taken by what a nonlinear step needs.
_A0, _A, _Y, _X, _Z, _W, _AHEAD, _REST = rows(9, 10, 11, 12, 13, 14, 15, 16)
_T, _MIDWAY_SPEED, _MIDWAY_TRAVEL, _MIDWAY_REST, _DX = rows(18, 19, 20, 21, 22)

#: Row of ``slopes`` midway through a step; 0 and 1 are now and ahead, 3 is ``AT_REST``.
(_BETWEEN,) = rows(2)
SLOPE_ROWS = 4

_LOAD = int(LOAD)


@inner
def friction_after(
    linear, term_index, term_value, pair_index, pair_value, path_index, path_value, path, at,
    vectors, slopes, row, torque, elapsed, travel, speed, out,
):  # fmt: skip
    """Friction after the travels and at the speeds of two rows of ``vectors``, with slopes.

    ``torque``: torques of the drives, shape (joints,); ``elapsed``: time since the positions Q and
    speeds V [s].
    """
    friction_torque(
        linear, term_index, term_value, pair_index, pair_value, vectors, speed, out, slopes, row
    )
    path_torque(
        path_index, path_value, path, at, pair_index.shape[0], torque,
        vectors, Q, V, elapsed, travel, speed, out, slopes, row,
    )  # fmt: skip


@_inline
def change(pair_index, pair_value, slopes, row, vectors, y, x, out):
    """Out = D y + K x, joint by joint times the share that load-dependent friction leaves."""
    slope_times(pair_index, pair_value, slopes, row, vectors, y, out)
    n = vectors.shape[1]
    stiffness = n + pair_index.shape[0]
    for i in range(n):
        vectors[out, i] += slopes[row, stiffness + i] * vectors[x, i]
        vectors[out, i] *= slopes[row, stiffness + n + i]


@_inline
def path_stiffness(pair_index, pair_value, matrices, slopes, row):
    """Bounds of ‖M⁻¹D‖ [1/s] and ‖M⁻¹K‖ [1/s²]."""
    n = matrices.shape[1]
    stiffness = n + pair_index.shape[0]
    square, share = 0.0, 1.0
    for i in range(n):
        square += matrices[MIDDLE, i, i] * abs(slopes[row, stiffness + i])
        share = max(share, slopes[row, stiffness + n + i])
    rate = damping_rate(pair_index, pair_value, matrices, slopes, row)
    return share * rate, share * square


@_inline
def inner_steps(rate, square, h, damping, oscillation):
    """How many inner steps ``h`` needs, in parts of one."""
    return max(rate * h / damping, np.sqrt(square) * h / oscillation)


@section
def advance_on_path(
    linear, term_index, term_value, pair_index, pair_value, path_index, path_value, path,
    vectors, matrices, slopes, clock, torque, h,
):  # fmt: skip
    """Integrate one step of length ``h`` [s] with the rigid body frozen at the step's middle.

    The state must come from ``evaluate``; the arguments are described there.
    """
    n = torque.size
    freeze_at_middle(vectors, matrices, clock, h)
    apply_matrix(matrices, MIDDLE, vectors, torque, MIDDLE_BIAS, FRICTION, _A0)
    feedback = _linear_step(pair_index, pair_value, vectors, matrices, slopes, h)
    change(pair_index, pair_value, slopes, NOW, vectors, _Y, _X, _Z)
    for i in range(n):
        vectors[_AHEAD, i] = vectors[V, i] + vectors[_Y, i]
    friction_after(
        linear, term_index, term_value, pair_index, pair_value, path_index, path_value, path, AHEAD,
        vectors, slopes, THEN, torque, h, _X, _AHEAD, _REST,
    )  # fmt: skip
    # friction of the load changes with the torque at the next sample
    last = path_index.shape[0] - 1
    loaded = last >= 0 and (
        path_index[last, 1] == _LOAD or (path_index[last, 1] < 0 and path_value[last, 3] > 0.0)
    )
    known = 0.0 if loaded else 1.0
    carried = slopes.shape[1] - n
    turning = rate_at_reversals(pair_index, pair_value, matrices, slopes, vectors, V, _AHEAD)
    sudden = turning * h > NONLINEAR_STIFFNESS
    small = not sudden
    for i in range(n):
        vectors[_REST, i] -= vectors[FRICTION, i] + vectors[_Z, i]
        level = vectors[LEVEL, i] + slopes[1, carried + i]
        if not abs(vectors[_REST, i]) <= LINEAR_REMAINDER * level:
            small = False
    if small:
        subtract_product(matrices, vectors, _REST, h / 3.0, _AHEAD, V)
        for i in range(n):
            vectors[_DX, i] = 0.25 * h * (vectors[V, i] - vectors[_AHEAD, i])
    elif sudden or not _simpson_step(
        linear, term_index, term_value, pair_index, pair_value, path_index, path_value, path,
        vectors, matrices, slopes, torque, h, feedback,
    ):  # fmt: skip
        _nonlinear_step(
            linear, term_index, term_value, pair_index, pair_value, path_index, path_value, path,
            vectors, matrices, slopes, torque, h,
        )  # fmt: skip
        clock[FRICTION_KNOWN] = known
        return
    for i in range(n):
        vectors[FRICTION, i] += vectors[_Z, i] + vectors[_REST, i]
        vectors[_A, i] = vectors[V, i] - vectors[_AHEAD, i]
        vectors[Q, i] += vectors[_X, i] + vectors[_DX, i]
    # F and z were taken where the linear step ended: carried on by their slopes there
    change(pair_index, pair_value, slopes, THEN, vectors, _A, _DX, _Z)
    for i in range(n):
        vectors[FRICTION, i] += vectors[_Z, i]
    for k in range(path.shape[1]):
        path[AHEAD, k] += path[RATE, k] * vectors[_DX, path_index[k, 0]]
    accept_states(path)
    for k in range(slopes.shape[1]):
        slopes[0, k] = slopes[1, k]
    clock[FRICTION_KNOWN] = known


@_inline
def _linear_step(pair_index, pair_value, vectors, matrices, slopes, h):
    """Change of speed _Y and travel _X from dy/dt = a - M⁻¹ (D y + K x), over ``h`` [s].

    Taylor polynomial of fourth order, term by term. Returns ‖M⁻¹D‖·h + ‖M⁻¹K‖·h².
    """
    n = vectors.shape[1]
    rate, square = path_stiffness(pair_index, pair_value, matrices, slopes, NOW)
    wanted = inner_steps(rate, square, h, STIFFNESS_PER_STEP, OSCILLATION_PER_STEP)
    count = int(np.ceil(min(max(wanted, 1e-3), MAX_INNER_STEPS)))
    step = h / count
    for i in range(n):
        vectors[_Y, i], vectors[_X, i], vectors[_A, i] = 0.0, 0.0, vectors[_A0, i]
    for s in range(count):
        for i in range(n):
            vectors[_W, i] = step * vectors[_A, i]
            vectors[_T, i] = step * (vectors[V, i] + vectors[_Y, i])
            vectors[_Y, i] += vectors[_W, i]
            vectors[_X, i] += vectors[_T, i]
        for order in range(2, 5):
            change(pair_index, pair_value, slopes, NOW, vectors, _W, _T, _Z)
            for i in range(n):
                vectors[_T, i] = step / order * vectors[_W, i]
                vectors[_X, i] += vectors[_T, i]
            subtract_product(matrices, vectors, _Z, step / order, STILL, _W)
            for i in range(n):
                vectors[_Y, i] += vectors[_W, i]
        for i in range(n):
            vectors[_X, i] += 0.2 * step * vectors[_W, i]
        if s < count - 1:
            change(pair_index, pair_value, slopes, NOW, vectors, _Y, _X, _Z)
            subtract_product(matrices, vectors, _Z, 1.0, _A0, _A)
    return rate * h + square * h * h


@section
def _simpson_step(
    linear, term_index, term_value, pair_index, pair_value, path_index, path_value, path,
    vectors, matrices, slopes, torque, h, feedback,
):  # fmt: skip
    """Correct the linear step by Simpson's rule for its remainder r; whether that was enough.

    State and travel at half the step come from the cubic through values and slopes at both ends.
    """
    n = torque.size
    carried = slopes.shape[1] - n
    for i in range(n):
        level = vectors[LEVEL, i] + slopes[1, carried + i]
        if not feedback * abs(vectors[_REST, i]) <= SIMPSON_FEEDBACK * level:
            return False
    # M⁻¹ (D y + K x) at the end is what the linear acceleration has lost until then
    subtract_product(matrices, vectors, _Z, -0.125 * h, STILL, _MIDWAY_SPEED)
    for i in range(n):
        vectors[_W, i] = vectors[_MIDWAY_SPEED, i] + 0.5 * vectors[_Y, i]
        vectors[_MIDWAY_SPEED, i] = vectors[V, i] + vectors[_W, i]
        vectors[_MIDWAY_TRAVEL, i] = 0.5 * vectors[_X, i] - 0.125 * h * vectors[_Y, i]
    friction_after(
        linear, term_index, term_value, pair_index, pair_value, path_index, path_value, path,
        MIDWAY, vectors, slopes, _BETWEEN, torque, 0.5 * h,
        _MIDWAY_TRAVEL, _MIDWAY_SPEED, _MIDWAY_REST,
    )  # fmt: skip
    change(pair_index, pair_value, slopes, NOW, vectors, _W, _MIDWAY_TRAVEL, _T)
    for i in range(n):
        vectors[_MIDWAY_REST, i] -= vectors[FRICTION, i] + vectors[_T, i]
        vectors[_T, i] = 4.0 * vectors[_MIDWAY_REST, i] + vectors[_REST, i]
        difference = abs(4.0 * vectors[_MIDWAY_REST, i] - vectors[_REST, i]) / 6.0
        level = vectors[LEVEL, i] + slopes[1, carried + i]
        if not difference <= SIMPSON_DIFFERENCE * level:
            return False
    subtract_product(matrices, vectors, _T, h / 6.0, _AHEAD, V)
    subtract_product(matrices, vectors, _MIDWAY_REST, h * h / 3.0, STILL, _DX)
    return True


@inner
def _nonlinear_step(
    linear, term_index, term_value, pair_index, pair_value, path_index, path_value, path,
    vectors, matrices, slopes, torque, h,
):  # fmt: skip
    """One step by Runge–Kutta 4 on travel and speed, rigid body frozen as prepared before.

    Friction may be much stiffer ahead than here, where a joint is about to stand still; so the
    stiffness is looked at again at every stage, and the inner step is shortened if it is too long.
    """
    n = torque.size
    k1, k2, k3, k4, trial, f, travel = _A0, _A, _Y, _X, _Z, _W, _T
    left, shortest = h, h / MAX_INNER_STEPS
    for i in range(n):
        vectors[f, i] = vectors[FRICTION, i]
    for k in range(slopes.shape[1]):
        slopes[1, k] = slopes[0, k]
    while left > 1e-9 * h:
        rate, square = path_stiffness(pair_index, pair_value, matrices, slopes, THEN)
        count = inner_steps(rate, square, left, NONLINEAR_STIFFNESS, NONLINEAR_OSCILLATION)
        step = min(max(left / np.ceil(max(count, 1e-3)), shortest), left)
        apply_matrix(matrices, MIDDLE, vectors, torque, MIDDLE_BIAS, f, k1)
        stage = 1
        while stage < 4:
            last = k1 if stage == 1 else (k2 if stage == 2 else k3)
            weight = 1.0 if stage == 3 else 0.5
            for i in range(n):
                before = vectors[V, i] if stage == 1 else vectors[trial, i]
                vectors[travel, i] = weight * step * before
                vectors[trial, i] = vectors[V, i] + weight * step * vectors[last, i]
            friction_after(
                linear, term_index, term_value, pair_index, pair_value,
                path_index, path_value, path,
                AHEAD, vectors, slopes, THEN, torque, weight * step, travel, trial, f,
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
            apply_matrix(matrices, MIDDLE, vectors, torque, MIDDLE_BIAS, f, target)
            stage += 1
        for i in range(n):
            inner = vectors[k2, i] + vectors[k3, i]
            vectors[travel, i] = step * (vectors[V, i] + step / 6.0 * (vectors[k1, i] + inner))
            gained = step / 6.0 * (vectors[k1, i] + 2.0 * inner + vectors[k4, i])
            vectors[trial, i] = vectors[V, i] + gained
        friction_after(
            linear, term_index, term_value, pair_index, pair_value, path_index, path_value, path,
            AHEAD, vectors, slopes, THEN, torque, step, travel, trial, f,
        )  # fmt: skip
        accept_states(path)
        for i in range(n):
            vectors[Q, i] += vectors[travel, i]
            vectors[V, i] = vectors[trial, i]
        left -= step
    for i in range(n):
        vectors[FRICTION, i] = vectors[f, i]
    for k in range(slopes.shape[1]):
        slopes[0, k] = slopes[1, k]
