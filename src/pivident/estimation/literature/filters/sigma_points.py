"""Filters by sigma points on (q, dq, θ): no derivatives, 2N + 1 steps of the robot a sample.

Points x̂ and x̂ ± c L_i, with P = L Lᵀ, go through the step; c² = α²(N + κ) of the unscented filter
(Julier and Uhlmann 1997; scaled: Julier 2002), c = √3 of central differences (Nørgaard, Poulsen and
Ravn 2000; van der Merwe 2004). From the points X after it,

    unscented    x̄ = Σ w_i X_i,    P = Σ w_i (X_i - x̄)(X_i - x̄)ᵀ + (1 - α² + β)(X_0 - x̄)(X_0 - x̄)ᵀ
                 w_0 = 1 - N/c²,   w_i = 1/(2c²)
    central      x̄ likewise,       P = Σ (X_i⁺ - X_i⁻)(·)ᵀ/(4c²)
                                       + (c² - 1)/(4c⁴) Σ (X_i⁺ + X_i⁻ - 2X_0)(·)ᵀ

The noises are added, that of the torque through A⁻¹ at x̂ without centrifugal terms. Measured are
positions, linear in x, so that the update is Kalman's.

The tangent of the step of x̂ says where the accelerations of the other points are searched. L is
triangular: points of the columns of θ have the motion of x̂ and parameters of their own, and need no
step but a few corrections; and θ does not move, so that its covariance stays what it was.

The square-root forms carry L: the weighted deviations stand side by side and their LQ factors are
made, a weight below zero is taken back by a rank-one update; no covariance is ever formed, which
halves the digits that are needed.
"""

from __future__ import annotations

import math

from pivident.estimation.literature.filters.filter_state import (
    DONE,
    NOT_POSITIVE,
    refused,
    torque_variance,
    update_positions,
    update_positions_of_factor,
    worst,
)
from pivident.estimation.literature.filters.midpoint_step import (
    ACCELERATION,
    FACTOR,
    beside,
    midpoint_step,
    step_tangent,
)
from pivident.estimation.literature.filters.triangular import (
    cholesky,
    lower_factor,
    solve_cholesky,
    update_factor,
)
from pivident.foundation.compiled import inner, kernel, summing


@summing
def _place_points(x, factor, scale, points):
    """Points x̂, then x̂ + c L_i and x̂ - c L_i in turn."""
    size = x.size
    for a in range(size):
        points[0, a] = x[a]
    for i in range(size):
        for a in range(size):
            way = scale * factor[a, i] if a >= i else 0.0
            points[1 + 2 * i, a], points[2 + 2 * i, a] = x[a] + way, x[a] - way


@summing
def _weigh(x, points, scale, central, alpha, beta, wide, gain):
    """Mean into x, weighted deviations into ``wide``, that of the middle into ``gain``.

    Returns its weight, zero for central differences.
    """
    size = x.size
    side, square = 0.5 / scale**2, scale * scale
    for a in range(size):
        total = 0.0  # deviations from the middle: nothing cancels
        for i in range(1, 2 * size + 1):
            total += points[i, a] - points[0, a]
        x[a] = points[0, a] + side * total
    first, second = 0.5 / scale, math.sqrt(max(square - 1.0, 0.0)) / (2.0 * square)
    root = math.sqrt(side)
    for i in range(size):
        for a in range(size):
            plus, minus = points[1 + 2 * i, a], points[2 + 2 * i, a]
            if central:
                wide[a, i] = first * (plus - minus)
                wide[a, size + i] = second * ((plus - points[0, a]) + (minus - points[0, a]))
            else:
                wide[a, i], wide[a, size + i] = root * (plus - x[a]), root * (minus - x[a])
    for a in range(size):
        gain[a] = points[0, a] - x[a]
    return 0.0 if central else 2.0 - size / square - alpha * alpha + beta


@summing
def _add_noise(wide, first, inverse, torque, drift, h):
    """Roots of the noises as columns from ``first`` on; how many columns there are."""
    n, size = torque.size, wide.shape[0]
    for a in range(size):
        for c in range(first, wide.shape[1]):
            wide[a, c] = 0.0
    for j in range(n):
        deviation = h * math.sqrt(torque[j])
        for i in range(n):
            wide[i, first + j] = 0.5 * h * deviation * inverse[i, j]
            wide[n + i, first + j] = deviation * inverse[i, j]
    last = first + n
    for k in range(drift.size):
        if drift[k] > 0.0:
            wide[2 * n + k, last] = math.sqrt(h * drift[k])
            last += 1
    return last


@summing
def _sum_squares(wide, columns, weight, middle, drift, h, covariance):
    """P = W Wᵀ + weight m mᵀ; of the parameters P + h diag(d²)."""
    moving = covariance.shape[0] - drift.size
    for k in range(drift.size):
        covariance[moving + k, moving + k] += h * drift[k]
    for a in range(covariance.shape[0]):
        for b in range(min(a + 1, moving)):
            total = weight * middle[a] * middle[b]
            for c in range(columns):
                total += wide[a, c] * wide[b, c]
            covariance[a, b], covariance[b, a] = total, total


@inner
def _invert(factor, inverse):
    """Columns of (L Lᵀ)⁻¹, as rows: it is symmetric."""
    for i in range(inverse.shape[0]):
        for j in range(inverse.shape[0]):
            inverse[i, j] = 0.0
        inverse[i, i] = 1.0
        solve_cholesky(factor, inverse[i])


@inner
def _move(equations, work, own, acceleration, tau, h, motion):
    """A point by a step of its own: -1, or the joint whose pivot is not positive.

    ``acceleration``: (joints,), where Newton's method starts, and ends.
    """
    n, found = tau.size, work.vectors[ACCELERATION]
    for j in range(n):
        found[j] = acceleration[j]
    joint = midpoint_step(
        equations, work, own[2 * n :], own[:n], own[n : 2 * n], tau, h, motion[0], motion[1]
    )
    for j in range(n):
        own[j], own[n + j], acceleration[j] = motion[0, j], motion[1, j], found[j]
    return joint


@summing
def _along_tangent(solved, x, own, h, middle, line):
    """Acceleration of a point to first order, by the tangent of the step of x̂."""
    n = middle.size
    for j in range(n):
        total = 0.0
        for k in range(n):
            faster = own[n + k] - x[n + k]
            total += solved[j, k] * (own[k] - x[k] + 0.5 * h * faster) + solved[j, n + k] * faster
        for k in range(2 * n, x.size):
            total += solved[j, k] * (own[k] - x[k])
        line[j] = middle[j] - total


@inner
def _move_points(equations, work, x, points, middle, bends, tau, h, motion, line, found):
    """All points but x̂, whose step was just made; the same.

    ``middle``: acceleration of x̂; ``bends``: what the tangent lacked of theirs in the last step,
    (points, joints); ``line`` and ``found``: scratch, (joints,).
    """
    n, count = tau.size, points.shape[0]
    for i in range(count - 1, 0, -1):  # those of θ first, while ``work`` still holds the step of x̂
        own, bend = points[i], bends[i]
        _along_tangent(work.solved, x, own, h, middle, line)
        for j in range(n):
            found[j] = line[j] + bend[j]
        if i > 4 * n and beside(equations, work, own[2 * n :], x[n : 2 * n], tau, h, found):
            for j in range(n):
                own[j] = x[j] + h * (x[n + j] + 0.5 * h * found[j])
                own[n + j] = x[n + j] + h * found[j]
        else:
            for j in range(n):
                found[j] = line[j] + bend[j]
            joint = _move(equations, work, own, found, tau, h, motion)
            if joint >= 0:
                return joint
        for j in range(n):
            bend[j] = found[j] - line[j]
    return -1


@kernel
def sigma_samples(
    equations, state, noise, h, tau, y, innovations, scale, central, alpha, beta, square_root
):
    """Advance over samples, with the torques before them: status, joint and sample.

    ``tau`` and ``y``: (samples, joints); ``innovations``: likewise, and √s, (2, samples, joints);
    ``scale``: c; ``central``: which of the two filters; ``square_root``: whether the state's factor
    is carried, or its covariance.
    """
    n, size = y.shape[1], state.x.size
    x, covariance, work = state.x, state.covariance, state.step
    points, wide, joined, gain = state.points, state.wide, state.joined, state.gain
    motion, inverse = state.motion, state.small[0]
    factor = state.factor
    middle, bends = state.accelerations[0], state.accelerations
    for k in range(y.shape[0]):
        if not square_root and cholesky(covariance, factor) >= 0:
            return NOT_POSITIVE, 0, k
        _place_points(x, factor, scale, points)
        joint = _move(equations, work, points[0], middle, tau[k], h, motion)
        if joint >= 0 or not step_tangent(equations, work, h):
            status, joint = refused(joint, n)
            return status, joint, k
        torque_variance(equations.couplings, noise, x[n : 2 * n], motion[1], state.torque)
        _invert(work.matrices[FACTOR], inverse)
        joint = _move_points(
            equations, work, x, points, middle, bends, tau[k], h, motion, state.rows[0, :n],
            state.rows[1, :n],
        )  # fmt: skip
        if joint >= 0:
            status, joint = refused(joint, n)
            return status, joint, k
        weight = _weigh(x, points, scale, central, alpha, beta, wide, gain)
        columns = _add_noise(wide, 2 * size, inverse, state.torque, noise.drift, h)
        if square_root:
            lower_factor(wide, columns)
            for a in range(size):
                for b in range(a + 1):
                    factor[a, b] = wide[a, b]
                gain[a] *= math.sqrt(abs(weight))
            if weight != 0.0 and update_factor(factor, gain, math.copysign(1.0, weight)) >= 0:
                return NOT_POSITIVE, 0, k
            status = update_positions_of_factor(
                x, factor, joined, state.innovation, noise.encoder, y[k]
            )
        else:
            _sum_squares(wide, columns, weight, gain, noise.drift, h, covariance)
            status = update_positions(x, covariance, gain, state.innovation, noise.encoder, y[k])
        for i in range(n):
            innovations[0, k, i] = state.innovation[0, i]
            innovations[1, k, i] = state.innovation[1, i]
        if status != DONE:
            return status, worst(state.innovation), k
    return DONE, -1, -1
