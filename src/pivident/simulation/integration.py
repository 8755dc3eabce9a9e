"""One sampling period of the robot under a held torque.

Rigid-body terms change slowly over a sampling period, friction near standstill does not: its
slope 2/π γ fc over a wrist's inertia gives rates of 27,000 1/s, five per period at 5 kHz. So the
rigid body is evaluated once per step, extrapolated to the step's middle,

    M⁻¹ ≈ M_k⁻¹ + (M_k⁻¹ - M_{k-1}⁻¹)/2,     h ≈ h_k + (h_k - h_{k-1})/2

and dv/dt = M⁻¹ (τ - h - f(v)) is integrated inside the step by Runge–Kutta 4 with as many inner
steps as the friction's stiffness Λ asks for. Runge–Kutta 4 on the full dynamics is there as the
oracle that this scheme is measured against.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from pivident.dynamics.forward import friction_torque
from pivident.dynamics.kernels import (
    RigidBodyWork,
    invert_mass_matrix,
    mass_matrix_and_bias,
    rigid_body_work,
)

#: Largest Λ·h of an inner Runge–Kutta step; its stability ends at 2.8, its accuracy before.
STIFFNESS_PER_STEP = 0.8


class State(NamedTuple):
    """Everything that one simulated robot carries from step to step, changed in place.

    Attributes:
        q: joint positions [rad or m], shape (joints,); ``v`` speeds and ``ddq`` accelerations.
        v: joint speeds.
        ddq: joint accelerations right after the torque was applied.
        inverse: M⁻¹ at this step and, first axis, the one before, shape (2, joints, joints).
        bias: h at this step and the one before, shape (2, joints).
        mass: scratch for M and its factor, shape (2, joints, joints).
        stages: scratch of the Runge–Kutta stages, shape (10, joints).
        friction: friction torques, shape (joints,).
        slope: friction slopes, shape (2, joints + couplings).
        work: scratch of the rigid body.
    """

    q: np.ndarray
    v: np.ndarray
    ddq: np.ndarray
    inverse: np.ndarray
    bias: np.ndarray
    mass: np.ndarray
    stages: np.ndarray
    friction: np.ndarray
    slope: np.ndarray
    work: RigidBodyWork


@njit(cache=True, nogil=True)
def make_state(model, q, v):
    """State at rest or in motion at the given positions and speeds."""
    n = q.size
    return State(
        q.copy(),
        v.copy(),
        np.zeros(n),
        np.zeros((2, n, n)),
        np.zeros((2, n)),
        np.zeros((2, n, n)),
        np.zeros((10, n)),
        np.zeros(n),
        np.zeros((2, n + model.friction.pair_sign.size)),
        rigid_body_work(n),
    )


@njit(cache=True, nogil=True, inline="always")
def _product(matrix, torque, bias, friction, out):
    """out = matrix (torque - bias - friction)."""
    n = out.size
    for i in range(n):
        out[i] = 0.0
    for j in range(n):
        net = torque[j] - bias[j] - friction[j]
        for i in range(n):
            out[i] += matrix[j, i] * net


@njit(cache=True, nogil=True)
def evaluate(model, state, torque):
    """Rigid body and acceleration at the present state under ``torque``.

    Returns:
        -1, or the joint whose pivot of M(q) is not positive (pivot on the diagonal of
        ``state.mass[1]``).
    """
    n = state.q.size
    for i in range(n):
        state.bias[1, i] = state.bias[0, i]
        for j in range(n):
            state.inverse[1, i, j] = state.inverse[0, i, j]
    mass_matrix_and_bias(
        model.tree,
        model.inertia,
        model.rotor,
        state.q,
        state.v,
        state.work,
        state.mass[0],
        state.bias[0],
    )
    joint = invert_mass_matrix(state.mass[0], state.mass[1], state.inverse[0])
    if joint >= 0:
        return joint
    friction_torque(model.friction, state.v, state.friction, state.slope[0])
    _product(state.inverse[0], torque, state.bias[0], state.friction, state.ddq)
    return -1


@njit(cache=True, nogil=True)
def _stiffness(friction, inverse, slope):
    """Upper bound of the largest eigenvalue of M⁻¹ D, D the friction's slope matrix: its trace."""
    n = inverse.shape[0]
    total = 0.0
    for i in range(n):
        total += inverse[i, i] * slope[i]
    for k in range(friction.pair_sign.size):
        i, j, ratio = friction.pair[k, 0], friction.pair[k, 1], friction.pair_value[k, 0]
        total += slope[n + k] * (
            inverse[i, i] + 2.0 * ratio * inverse[i, j] + ratio * ratio * inverse[j, j]
        )
    return total


@njit(cache=True, nogil=True)
def advance_frozen(model, state, torque, h, first):
    """Integrate one step of length ``h`` [s] with the rigid body frozen at the step's middle.

    Args:
        model: robot and parameters.
        state: state after ``evaluate``, moved on in place.
        torque: held joint torques, shape (joints,).
        h: length of the step.
        first: whether there is no earlier step to extrapolate from.
    """
    n = state.q.size
    q, v = state.q, state.v
    middle, bias = state.mass[0], state.stages[0]
    weight = 0.0 if first else 0.5
    for i in range(n):
        bias[i] = state.bias[0, i] + weight * (state.bias[0, i] - state.bias[1, i])
        for j in range(n):
            middle[i, j] = state.inverse[0, i, j] + weight * (
                state.inverse[0, i, j] - state.inverse[1, i, j]
            )
    k1, k2, k3, k4 = state.stages[1], state.stages[2], state.stages[3], state.stages[4]
    trial, f = state.stages[5], state.stages[6]
    for i in range(n):
        f[i] = state.friction[i]
    stiffness = _stiffness(model.friction, middle, state.slope[0])
    left = h
    while left > 0.0:
        step = left
        if stiffness * step > STIFFNESS_PER_STEP:
            # equal inner steps: a last sliver would cost as much as a whole one
            step = left / np.ceil(stiffness * left / STIFFNESS_PER_STEP)
        _product(middle, torque, bias, f, k1)
        while True:
            for i in range(n):
                trial[i] = v[i] + 0.5 * step * k1[i]
            friction_torque(model.friction, trial, f, state.slope[1])
            # friction may be stiffer half a step ahead: joints pass through standstill
            ahead = _stiffness(model.friction, middle, state.slope[1])
            if ahead * step <= 1.5 * STIFFNESS_PER_STEP or step < 1e-3 * h:
                break
            step = max(STIFFNESS_PER_STEP / ahead, 0.999e-3 * h)
        _product(middle, torque, bias, f, k2)
        for i in range(n):
            trial[i] = v[i] + 0.5 * step * k2[i]
        friction_torque(model.friction, trial, f, state.slope[1])
        _product(middle, torque, bias, f, k3)
        for i in range(n):
            trial[i] = v[i] + step * k3[i]
        friction_torque(model.friction, trial, f, state.slope[1])
        _product(middle, torque, bias, f, k4)
        for i in range(n):
            q[i] += step * (v[i] + step / 6.0 * (k1[i] + k2[i] + k3[i]))
            v[i] += step / 6.0 * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i])
        left -= step
        if left <= 1e-9 * h:
            break
        friction_torque(model.friction, v, f, state.slope[1])
        stiffness = _stiffness(model.friction, middle, state.slope[1])


@njit(cache=True, nogil=True)
def advance_runge_kutta(model, state, torque, h, substeps):
    """Integrate one step by classical Runge–Kutta on the full dynamics, the oracle.

    Returns:
        -1, or the joint whose pivot of M(q) is not positive.
    """
    n = state.q.size
    step = h / substeps
    q0, v0, dq, dv = state.stages[0], state.stages[1], state.stages[2], state.stages[3]
    for _ in range(substeps):
        for i in range(n):
            q0[i], v0[i] = state.q[i], state.v[i]
            dq[i], dv[i] = 0.0, 0.0
        for stage in range(4):
            joint = evaluate(model, state, torque)
            if joint >= 0:
                return joint
            weight = 2.0 if stage in (1, 2) else 1.0
            ahead = step if stage == 2 else 0.5 * step
            for i in range(n):
                dq[i] += weight * state.v[i]
                dv[i] += weight * state.ddq[i]
                state.q[i] = q0[i] + ahead * state.v[i]
                state.v[i] = v0[i] + ahead * state.ddq[i]
        for i in range(n):
            state.q[i] = q0[i] + step / 6.0 * dq[i]
            state.v[i] = v0[i] + step / 6.0 * dv[i]
    return -1
