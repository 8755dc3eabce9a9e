"""The auxiliary model of section 3.3: the arm in its loop, driven by the reference alone.

The controller holds its torque over a sampling period T:
τ = kp (q_r - q) + kd (dq_r - F Δq/T) + ki T Σ(q_r - q), F a lag of first order or 1.
Over one period the mass matrix is that of the middle, and friction, stiff at γ = 150 s/rad,
acts at the mean of the velocities before and after (implicit midpoint rule, by Newton's method).
"""

from dataclasses import dataclass

import numba
import numpy as np

from tests.independent.arm import (
    COLUMNS,
    COULOMB,
    COULOMB_MOTOR,
    GAMMA,
    GRAVITY,
    VISCOUS,
    VISCOUS_MOTOR,
    rows,
)

MAX_ERROR = 1.0  # rad: behind it the simulated arm is said to have run away


@dataclass(frozen=True)
class Record:
    """What an experiment leaves: signals (samples, joints), and gains of the loop at the joint."""

    rate: float
    q_r: np.ndarray
    dq_r: np.ndarray
    q_m: np.ndarray
    tau: np.ndarray
    kp: np.ndarray
    kd: np.ndarray
    ki: np.ndarray
    lag: float = 0.0  # of the derivative [s]


@numba.njit(cache=True)
def friction_of(v, theta, columns, slope):
    """Torques of friction at velocities v; their derivatives with respect to v go into slope."""
    torque = np.zeros(len(v))
    slope[:] = 0.0
    for k in range(len(theta)):
        kind, j = columns[k, 0], columns[k, 1]
        if kind == VISCOUS:
            torque[j] += theta[k] * v[j]
            slope[j, j] += theta[k]
        elif kind == COULOMB:
            torque[j] += theta[k] * 2 / np.pi * np.arctan(GAMMA * v[j])
            slope[j, j] += theta[k] * 2 / np.pi * GAMMA / (1 + (GAMMA * v[j]) ** 2)
        elif kind == VISCOUS_MOTOR:
            torque[4] += theta[k] * v[5]
            torque[5] += theta[k] * v[4]
            slope[4, 5] += theta[k]
            slope[5, 4] += theta[k]
        elif kind == COULOMB_MOTOR:
            both = v[4] + v[5]
            for i in (4, 5):
                torque[i] += theta[k] * 2 / np.pi * np.arctan(GAMMA * both)
                for m in (4, 5):
                    slope[i, m] += theta[k] * 2 / np.pi * GAMMA / (1 + (GAMMA * both) ** 2)
    return torque


@numba.njit(cache=True)
def counted(q, count):
    """Positions as an encoder counts them; as they are where a count is zero."""
    read = q.copy()
    for j in range(len(q)):
        if count[j] > 0:
            read[j] = np.rint(q[j] / count[j]) * count[j]
    return read


@numba.njit(cache=True)
def solved(matrix, right):
    """Solution of equations with a positive definite matrix, by elimination without pivots."""
    size, left, x = len(right), matrix.copy(), right.copy()
    for k in range(size):
        for i in range(k + 1, size):
            share = left[i, k] / left[k, k]
            for j in range(k + 1, size):
                left[i, j] -= share * left[k, j]
            x[i] -= share * x[k]
    for k in range(size - 1, -1, -1):
        for j in range(k + 1, size):
            x[k] -= left[k, j] * x[j]
        x[k] /= left[k, k]
    return x


@numba.njit(cache=True)
def run(theta, start, q_r, dq_r, noise, count, kp, kd, ki, lag, step, first, columns):
    """Positions, velocities and torques of the loop, with NaN from where the arm runs away."""
    samples, joints = q_r.shape
    q, dq, tau = (
        np.full((samples, joints), np.nan),
        np.full((samples, joints), np.nan),
        np.zeros((samples, joints)),
    )
    axes, phi = np.empty((joints, 3, 3)), np.empty((joints, len(columns)))
    mass, slope, still = np.empty((joints, joints)), np.empty((joints, joints)), np.zeros(joints)
    q[0], dq[0] = start
    before, charge, speed = counted(q[0] + noise[0], count), first.copy(), np.zeros(joints)
    for i in range(samples):
        measured = counted(q[i] + noise[i], count)
        error = q_r[i] - measured
        if not np.all(np.abs(error) < MAX_ERROR):
            q[i:] = np.nan
            return q, dq, tau
        charge += ki * step * error
        speed = (lag * speed + measured - before) / (lag + step)
        tau[i] = kp * error + kd * (dq_r[i] - speed) + charge
        before = measured
        if i == samples - 1:
            break
        middle = q[i] + 0.5 * step * dq[i]
        rows(middle, dq[i], still, GRAVITY, False, columns, axes, phi)
        drive = tau[i] - phi @ theta
        for j in range(joints):
            unit = np.zeros(joints)
            unit[j] = 1.0
            rows(middle, still, unit, 0.0, False, columns, axes, phi)
            mass[:, j] = phi @ theta
        v = dq[i].copy()
        for _ in range(20):
            short = mass @ (v - dq[i]) - step * (
                drive - friction_of(0.5 * (v + dq[i]), theta, columns, slope)
            )
            change = solved(mass + 0.5 * step * slope, short)
            v = v - change
            if np.max(np.abs(change)) < 1e-10:
                break
        dq[i + 1] = v
        q[i + 1] = q[i] + 0.5 * step * (dq[i] + v)
    return q, dq, tau


def simulated(
    record: Record,
    theta: np.ndarray,
    noise: np.ndarray | None = None,
    count: np.ndarray | None = None,
    start: np.ndarray | None = None,
) -> tuple[np.ndarray, ...]:
    """Positions, velocities, accelerations and torques of the loop with the parameters theta.

    The arm starts with the positions and velocities given, shape (2, joints), else with those of
    the reference, and with an empty integral. Noise and counts, where there are any, are those of
    the positions that the controller reads.
    """
    step, nothing = 1 / record.rate, np.zeros(record.q_r.shape[1])
    noise = np.zeros_like(record.q_r) if noise is None else noise
    count = nothing if count is None else count
    law = record.kp, record.kd, record.ki, record.lag, step
    start = np.stack([record.q_r[0], record.dq_r[0]]) if start is None else start
    q_r, dq_r = np.array(record.q_r), np.array(record.dq_r)  # numba compiles read-only ones anew
    q, dq, tau = run(theta, start, q_r, dq_r, noise, count, *law, nothing, COLUMNS)
    if not np.isfinite(q).all():
        lost = int(np.flatnonzero(~np.isfinite(q).all(axis=1))[0])
        raise ArithmeticError(f"The simulated arm runs away at {lost * step:.3g} s.")
    return q, dq, np.gradient(dq, step, axis=0), tau
