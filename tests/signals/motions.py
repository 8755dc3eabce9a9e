"""A point-to-point motion with smooth accelerations, and exact smoothers to compare with."""

import numpy as np
from scipy.linalg import cho_solve_banded, cholesky_banded

from pivident.signals.random_walk_model import difference_coefficients

RATE = 5000.0


def point_to_point(samples=34_500, seed=1):
    """Trapezoidal speeds of 1.5 rad/s and 8 rad/s², ramps rounded over 40 ms: q and ddq."""
    rng = np.random.default_rng(seed)
    ddq = np.zeros(samples)
    start, at = 250, 0.0
    while start < samples - 3500:
        goal = rng.uniform(-1.5, 1.5)
        distance, at = goal - at, goal
        ramp = min(np.sqrt(abs(distance) / 8.0), 1.5 / 8.0)
        cruise = max(abs(distance) / 1.5 - ramp, 0.0) if ramp == 1.5 / 8.0 else 0.0
        on, flat = int(ramp * RATE), int(cruise * RATE)
        ddq[start : start + on] += 8.0 * np.sign(distance)
        ddq[start + on + flat : start + 2 * on + flat] -= 8.0 * np.sign(distance)
        start += 2 * on + flat + 200
    window = np.hanning(201)
    ddq = np.convolve(ddq, window / window.sum(), "same")
    q = np.cumsum(np.cumsum(ddq)) / RATE**2
    return q, np.gradient(np.gradient(q, 1 / RATE), 1 / RATE)


def difference_matrix(samples, order):
    return np.diff(np.eye(samples), order, axis=0)


def omega(samples, order, nvr):
    """Ω = NVR I + D Dᵀ, dense."""
    d = difference_matrix(samples, order)
    return nvr * np.eye(samples - order) + d @ d.T


def level_by_cholesky(y, order, nvr):
    """T = y - Dᵀ Ω⁻¹ D y by SciPy's banded Cholesky factorisation."""
    d = np.array(difference_coefficients(order))
    bands = np.correlate(d, d, "full")[order:]
    matrix = np.tile(bands[:, None], y.size - order)
    matrix[0] += nvr
    z = cho_solve_banded((cholesky_banded(matrix, lower=True), True), np.diff(y, order))
    return y - np.convolve(z, d)


def level_by_penalty(y, order, nvr):
    """T minimising ‖y - T‖² + ‖ΔᵐT‖² / NVR: the smoother of Whittaker, Hodrick and Prescott."""
    d = difference_matrix(y.size, order)
    return np.linalg.solve(np.eye(y.size) + d.T @ d / nvr, y)


def level_in_extended_precision(y, order, nvr):
    """T by a banded LDLᵀ factorisation of Ω in 80-bit arithmetic."""
    d = np.array(difference_coefficients(order), dtype=np.longdouble)
    bands = [(d[: order + 1 - k] * d[k:]).sum() for k in range(order + 1)]
    bands[0] += np.longdouble(nvr)
    w = y.astype(np.longdouble)
    for _ in range(order):
        w = np.diff(w)
    n = w.size
    lower = np.zeros((n, order + 1), dtype=np.longdouble)
    pivot, z = np.zeros(n, dtype=np.longdouble), np.zeros(n, dtype=np.longdouble)
    for j in range(n):
        width = min(order, j)
        for k in range(width, -1, -1):
            i = j - k
            value = bands[k]
            for p in range(k + 1, width + 1):
                value -= lower[j, p] * lower[i, p - k] * pivot[j - p]
            if k:
                lower[j, k] = value / pivot[i]
            else:
                pivot[j] = value
        z[j] = w[j] - sum(lower[j, p] * z[j - p] for p in range(1, width + 1))
    z /= pivot
    for j in range(n - 1, -1, -1):
        for p in range(1, min(order, n - 1 - j) + 1):
            z[j] -= lower[j + p, p] * z[j + p]
    level = y.astype(np.longdouble)
    for k in range(order + 1):
        level[k : k + n] -= d[k] * z
    return level
