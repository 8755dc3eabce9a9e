"""State, noise and scratch of a filter on x = (q, dq, θ), and the update with measured positions.

Measured are y = q + v, with independent noise of each joint. The torque that acts between two
samples has white noise w, which reaches the state through A⁻¹ of the step, and the parameters walk:

    x⁺ = f(x, τ + w),   cov w = diag(σ_τ²),   cov(θ⁺ - θ) = h diag(d²)

At standstill dry friction follows no law, and a step that passes through it meets both of its
signs: there a joint's torque has the noise of dry friction that is not known, besides.

Positions are taken one joint at a time, which needs no inverse:

    s = P_jj + r_j,   z_j = (y_j - q_j)/√s,   x ← x + P_·j z_j/√s,   P ← P - P_·j P_j·/s

z_j are the innovations, white and of unit variance if the noises are as assumed.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from pivident.estimation.literature.filters.midpoint_step import StepWork, step_work
from pivident.estimation.literature.filters.robot_equations import RobotEquations
from pivident.estimation.literature.filters.triangular import lower_factor
from pivident.foundation.compiled import inlined, inner

#: What may happen: nothing; no mass matrix, covariance, innovation or loops that a filter can go on
#: with.
DONE, INDEFINITE, NOT_POSITIVE, FAR, OPEN = range(5)

#: Innovation, in standard deviations, at which a filter has diverged.
MAX_INNOVATION = 100.0


class FilterNoise(NamedTuple):
    """Noises that a filter assumes."""

    encoder: np.ndarray  # variance of measured positions, (joints,) [rad² or m²]
    torque: np.ndarray  # variance of the torque of a period, (joints,) [(N m)² or N²]
    still: np.ndarray  # the same at standstill, likewise
    limit: np.ndarray  # speed that counts as standstill, (joints,) [rad/s or m/s]
    drift: np.ndarray  # variance that a parameter gains in a second, (parameters,)


class FilterState(NamedTuple):
    """Estimate and scratch of a Kalman filter; N = 2 joints + parameters."""

    x: np.ndarray  # q, dq and θ, (N,)
    covariance: np.ndarray  # P, (N, N); square-root filters leave it alone
    factor: np.ndarray  # its lower Cholesky factor, for sigma points
    innovation: np.ndarray  # z of the last sample, and √s, (2, joints) [-, rad or m]
    torque: np.ndarray  # variance of the torque in this period, (joints,)
    motion: np.ndarray  # scratch, q⁺ and dq⁺, (2, joints)
    gain: np.ndarray  # scratch, (N,)
    rows: np.ndarray  # scratch, (2 joints, N)
    small: np.ndarray  # scratch, (3, joints, joints)
    points: np.ndarray  # sigma points, (2N + 1, N)
    accelerations: np.ndarray  # of x̂ in its last step, then what its tangent lacked of those of
    # the points, (2N + 1, joints)
    wide: np.ndarray  # deviations and roots of noise, (N, 2N + N)
    joined: np.ndarray  # scratch of the update of factors, (joints + N, joints + N)
    step: StepWork


class FilterRun(NamedTuple):
    """A filter and the samples that it takes.

    Attributes:
        equations: of the robot.
        state: of the filter, which is changed.
        noise: variances of torques and positions.
        period: time between two samples [s].
        tau: torques before each sample, shape (samples, joints) [N m or N].
        q: measured positions, shape (samples, joints) [rad or m].
        innovations: takes them in standard deviations and in [rad or m], shape (2, samples,
            joints).
    """

    equations: RobotEquations
    state: FilterState
    noise: FilterNoise
    period: float
    tau: np.ndarray
    q: np.ndarray
    innovations: np.ndarray


def filter_state(equations: RobotEquations, sigma_points: bool) -> FilterState:
    """Empty state for a robot; sigma points take most of its memory."""
    n, p = equations.joints, len(equations.floor)
    size = 2 * n + p
    own = size if sigma_points else 0
    return FilterState(
        np.zeros(size), np.zeros((size, size)), np.zeros((own, own)), np.zeros((2, n)),
        np.zeros(n), np.zeros((2, n)),
        np.zeros(size), np.zeros((2 * n, size)), np.zeros((3, n, n)),
        np.zeros((2 * own + 1, own)), np.zeros((2 * own + 1, n)),
        np.zeros((own, 3 * own)), np.zeros((n + own, n + own)),
        step_work(equations),
    )  # fmt: skip


@inlined
def refused(joint, n):
    """Status and joint of a step that was not made, from what ``midpoint_step`` has returned."""
    if joint == n:
        return OPEN, 0
    return INDEFINITE, max(joint, 0)


@inlined
def _stands_still(now, then, limit):
    """Whether a speed is, or passes through, what counts as standstill."""
    if limit == 0.0:
        return False
    return abs(now) <= limit or abs(then) <= limit or now * then < 0.0


@inner
def torque_variance(couplings, noise, dq, ahead, out):
    """Noise of the torques between two speeds: larger where a joint or a motor stands still."""
    for j in range(out.size):
        out[j] = noise.torque[j]
        if _stands_still(dq[j], ahead[j], noise.limit[j]):
            out[j] = noise.still[j]
    for c in range(couplings.shape[0]):
        i, j = int(couplings[c, 0]), int(couplings[c, 1])
        now, then = dq[i] + couplings[c, 2] * dq[j], ahead[i] + couplings[c, 2] * ahead[j]
        if _stands_still(now, then, noise.limit[i]):
            out[i], out[j] = noise.still[i], noise.still[j]


@inner
def update_positions(x, covariance, gain, innovation, encoder, y):
    """Positions y, joint by joint, into x and P."""
    size = x.size
    for j in range(y.size):
        total = covariance[j, j] + encoder[j]
        if not total > 0.0:
            innovation[0, j] = np.nan
            return NOT_POSITIVE
        error = y[j] - x[j]
        innovation[1, j] = math.sqrt(total)
        innovation[0, j] = error / innovation[1, j]
        inverse = 1.0 / total
        for a in range(size):
            gain[a] = covariance[a, j]
        for a in range(size):
            share = gain[a] * inverse
            x[a] += share * error
            for b in range(size):
                covariance[a, b] -= share * gain[b]
    return check_innovation(innovation)


@inner
def update_positions_of_factor(x, factor, joined, innovation, encoder, y):
    """The same with the lower factor S of P: LQ of [√R S_q; 0 S] = [S_y 0; K̄ S⁺]."""
    n, size = y.size, x.size
    for a in range(n + size):
        for b in range(n + size):
            joined[a, b] = 0.0
    for j in range(n):
        joined[j, j] = math.sqrt(encoder[j])
        for b in range(j + 1):
            joined[j, n + b] = factor[j, b]
    for a in range(size):
        for b in range(a + 1):
            joined[n + a, n + b] = factor[a, b]
    lower_factor(joined, n + size)
    for j in range(n):
        error = y[j] - x[j]
        for b in range(j):
            error -= joined[j, b] * innovation[0, b]
        innovation[1, j] = joined[j, j]
        innovation[0, j] = error / joined[j, j]
    for a in range(size):
        for j in range(n):
            x[a] += joined[n + a, j] * innovation[0, j]
        for b in range(a + 1):
            factor[a, b] = joined[n + a, n + b]
    return check_innovation(innovation)


@inner
def check_innovation(innovation):
    """Whether the positions are where the filter can believe them; NaN is not."""
    for j in range(innovation.shape[1]):
        if not abs(innovation[0, j]) <= MAX_INNOVATION:
            return FAR
    return DONE


@inner
def worst(innovation):
    """Joint with the largest innovation, the first that is NaN."""
    found = 0
    for j in range(innovation.shape[1]):
        if not abs(innovation[0, j]) <= abs(innovation[0, found]):
            found = j
    return found
