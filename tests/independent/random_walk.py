"""Section 4.2: the integrated random walk smoother, its noise variance ratio by likelihood.

Time is counted in samples, so that the state is position and position per sample: (27) with Δt = 1.
"""

import numba
import numpy as np
from scipy.optimize import minimize_scalar

UNKNOWN = 1e10  # variance of the state at the start, in variances of the measurement noise
MIN_EXPONENT, MAX_EXPONENT = -16.0, 4.0  # of the noise variance ratio, to the base of ten


@numba.njit(cache=True)
def deviance(y, ratio):
    """-2 log L of the prediction errors but for a constant, the best noise variance put in."""
    x, v, a, b, c = y[0], 0.0, UNKNOWN, 0.0, UNKNOWN
    squares, logs = 0.0, 0.0
    for i in range(len(y)):
        x, a, b, c = x + v, a + 2 * b + c, b + c, c + ratio
        spread, error = a + 1.0, y[i] - x
        if i >= 2:  # the first two only say where the signal starts
            squares += error * error / spread
            logs += np.log(spread)
        x, v = x + a / spread * error, v + b / spread * error
        a, b, c = a / spread, b / spread, c - b * b / spread
    return (len(y) - 2) * np.log(squares / (len(y) - 2)) + logs


@numba.njit(cache=True)
def smoothed(y, ratio):
    """Level and slope of the walk given all samples (Rauch, Tung and Striebel)."""
    n = len(y)
    at, cov = np.empty((n, 2)), np.empty((n, 3))
    x, v, a, b, c = y[0], 0.0, UNKNOWN, 0.0, UNKNOWN
    for i in range(n):
        x, a, b, c = x + v, a + 2 * b + c, b + c, c + ratio
        spread, error = a + 1.0, y[i] - x
        x, v = x + a / spread * error, v + b / spread * error
        a, b, c = a / spread, b / spread, c - b * b / spread
        at[i], cov[i] = (x, v), (a, b, c)
    level, slope = np.empty(n), np.empty(n)
    level[-1], slope[-1] = at[-1]
    for i in range(n - 2, -1, -1):
        a, b, c = cov[i]
        pa, pb, pc = a + 2 * b + c, b + c, c + ratio
        det = pa * pc - pb * pb
        first, second = level[i + 1] - at[i, 0] - at[i, 1], slope[i + 1] - at[i, 1]
        first, second = (pc * first - pb * second) / det, (pa * second - pb * first) / det
        level[i] = at[i, 0] + (a + b) * first + b * second
        slope[i] = at[i, 1] + (b + c) * first + c * second
    return level, slope


def likeliest_ratio(y: np.ndarray) -> float:
    """The noise variance ratio of largest likelihood."""
    found = minimize_scalar(
        lambda exponent: deviance(y, 10.0**exponent),
        bounds=(MIN_EXPONENT, MAX_EXPONENT),
        method="bounded",
        options={"xatol": 1e-5},
    )
    return 10.0**found.x


def derivatives(q_m: np.ndarray, rate: float, second: str, slopes: str) -> tuple[np.ndarray, ...]:
    """Position, velocity and acceleration by two passes, the second over the velocity of the first.

    second says where the second pass has its ratio from: its own likelihood, or the first pass.
    The slope of (27) is that to the next sample: taken as it is, in the "state", or "centred".
    """
    signals = np.empty((3, *q_m.shape))
    for j, y in enumerate(np.ascontiguousarray(q_m.T)):
        ratio = likeliest_ratio(y)
        signals[0][:, j], dq = smoothed(y, ratio)
        ddq = smoothed(dq, likeliest_ratio(dq) if second == "own" else ratio)[1]
        if slopes == "centred":  # half a sample later than said, and twice that
            dq, ddq = 0.5 * (dq + np.r_[dq[0], dq[:-1]]), np.r_[ddq[0], ddq[:-1]]
        signals[1][:, j], signals[2][:, j] = rate * dq, rate**2 * ddq
    return tuple(signals)
