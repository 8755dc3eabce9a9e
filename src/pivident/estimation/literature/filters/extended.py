"""Extended Kalman filter on (q, dq, θ) with the exact tangent of its step.

    P ← F P Fᵀ + G C Gᵀ + h diag(0, d²),     F = 1 + E

E has rows for the state alone: with T = ∂a/∂x of `midpoint_step`,

    E_q = h [0 1 0] + h²/2 T,     E_dq = h T,     G = [h²/2; h; 0],     C = A⁻¹ diag(σ_τ²) A⁻ᵀ

so that a sample costs N² products for each joint, not N³ (Ljung 1979 on filters of states and
parameters: their estimates converge where the noises are as assumed, and may diverge elsewhere).
"""

from __future__ import annotations

from pivident.estimation.literature.filters.filter_state import (
    DONE,
    FilterRun,
    refused,
    torque_variance,
    update_positions,
    worst,
)
from pivident.estimation.literature.filters.midpoint_step import midpoint_step, step_tangent
from pivident.foundation.compiled import kernel, summing


@summing
def propagate(covariance, rows, solved, noise_torque, drift, h, scratch):
    """P of the next sample; ``solved``: A⁻¹ [K B Φ 1]; see above."""
    size, n = covariance.shape[0], noise_torque.size
    p = size - 2 * n
    tangent, part, spread = scratch[0], scratch[1], scratch[2]
    for i in range(n):  # T of the state; that of θ is -A⁻¹Φ as it stands
        for j in range(n):
            tangent[i, j] = -solved[i, j]
            part[i, j] = -solved[i, n + j] - 0.5 * h * solved[i, j]
    for i in range(n):
        for a in range(size):
            rows[n + i, a] = 0.0
        for b in range(size):
            if b < n:
                share = tangent[i, b]
            elif b < 2 * n:
                share = part[i, b - n]
            else:
                share = -solved[i, b]
            if share != 0.0:
                for a in range(size):
                    rows[n + i, a] += share * covariance[b, a]
        for a in range(size):
            rows[i, a] = h * covariance[n + i, a] + 0.5 * h * h * rows[n + i, a]
            rows[n + i, a] *= h
    # E P Eᵀ, before P changes: of rows E P, columns of the state
    for s in range(2 * n):
        for i in range(n):
            total = 0.0
            for b in range(n):
                total += rows[s, b] * tangent[i, b] + rows[s, n + b] * part[i, b]
            for b in range(p):
                total -= rows[s, 2 * n + b] * solved[i, 2 * n + b]
            spread_q, spread_v = h * rows[s, n + i] + 0.5 * h * h * total, h * total
            if s >= i:
                covariance[s, i] += spread_q
                if s != i:
                    covariance[i, s] += spread_q
            if s >= n + i:
                covariance[s, n + i] += spread_v
                if s != n + i:
                    covariance[n + i, s] += spread_v
    for s in range(2 * n):
        for a in range(size):
            covariance[s, a] += rows[s, a]
            covariance[a, s] += rows[s, a]
    for i in range(n):
        for j in range(i + 1):
            total = 0.0
            for b in range(n):
                total += solved[i, 2 * n + p + b] * noise_torque[b] * solved[j, 2 * n + p + b]
            spread[i, j], spread[j, i] = total, total
    for i in range(n):
        for j in range(n):
            c = spread[i, j]
            covariance[i, j] += 0.25 * h**4 * c
            covariance[i, n + j] += 0.5 * h**3 * c
            covariance[n + i, j] += 0.5 * h**3 * c
            covariance[n + i, n + j] += h * h * c
    for k in range(p):
        covariance[2 * n + k, 2 * n + k] += h * drift[k]


@kernel
def extended_samples(equations, state, noise, h, tau, y, innovations):
    """Advance over samples, with the torques before them: status, joint and sample.

    ``tau`` and ``y``: (samples, joints); ``innovations``: likewise, and √s, (2, samples, joints).
    """
    n = y.shape[1]
    x, covariance, work, motion = state.x, state.covariance, state.step, state.motion
    q, dq, theta = x[:n], x[n : 2 * n], x[2 * n :]
    for k in range(y.shape[0]):
        joint = midpoint_step(equations, work, theta, q, dq, tau[k], h, motion[0], motion[1])
        if joint >= 0 or not step_tangent(equations, work, h):
            status, joint = refused(joint, n)
            return status, joint, k
        torque_variance(equations.couplings, noise, dq, motion[1], state.torque)
        propagate(covariance, state.rows, work.solved, state.torque, noise.drift, h, state.small)
        for i in range(n):
            q[i], dq[i] = motion[0, i], motion[1, i]
        status = update_positions(x, covariance, state.gain, state.innovation, noise.encoder, y[k])
        for i in range(n):
            innovations[0, k, i] = state.innovation[0, i]
            innovations[1, k, i] = state.innovation[1, i]
        if status != DONE:
            return status, worst(state.innovation), k
    return DONE, -1, -1


class ExtendedSteps:
    """Steps of the extended Kalman filter."""

    needs_points = False
    square_root = False

    def advance(self, run: FilterRun) -> tuple[int, int, int]:
        """Take samples; status, joint and sample at which it ended."""
        return extended_samples(*run)
