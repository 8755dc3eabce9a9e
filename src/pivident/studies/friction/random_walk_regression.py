"""A parameter that walks along its state: Kalman filter and fixed-interval smoother, compiled.

On data sorted by a state x, with the coordinate u that runs from 0 to 1 over its range,

    y_k = p(u_k) z_k + e_k,   e ~ N(0, r),
    order 1:  dp = dw,             Var(dw) = NVR r du          (random walk)
    order 2:  dp = s du, ds = dw                               (integrated random walk)

between *uneven* steps of u, hence (Wahba 1978) the smoothing spline of degree 1 or 3. Young's
sorted-data walk takes one step per sample regardless of the states; with the rank as coordinate it
is the same recursion. The start is diffuse up to `START`. The backward pass is the recursion of
de Jong (1989), which inverts no matrix, so ties in the state are harmless. All variances are in
units of r.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pivident.foundation.compiled import compiled
from pivident.foundation.golden_section import lowest

#: Variance of level and slope before the first sample, in units of the noise variance.
START = 1e7

#: Bandwidths h of the search, as shares of the state's range: NVR = 1/(n h⁴) (order 2).
NARROWEST, WIDEST = 0.002, 4.0

_GRID_POINTS = 25
_TOLERANCE = 0.03


@dataclass(frozen=True, eq=False)
class SmoothedParameter:
    """A parameter along its sorted state."""

    value: np.ndarray  # p at each coordinate, shape (samples,)
    variance: np.ndarray  # its variance in units of the noise variance r, likewise
    log_likelihood: float  # with r concentrated out
    noise_variance: float  # r̂ of the one-step-ahead errors


@compiled()
def _filter(u, z, y, nvr, order, store):
    """Forward pass; rows of ``store``: a0 a1 P00 P01 P11 v F K0 K1, before each update."""
    a0 = a1 = 0.0
    p00 = START
    p01 = 0.0
    p11 = START if order == 2 else 0.0
    log_f = squares = 0.0
    count = 0
    for k in range(u.size):
        if k > 0:
            d = u[k] - u[k - 1]
            q = nvr * d
            if order == 2:
                a0 += d * a1
                p00 += 2.0 * d * p01 + d * d * p11 + q * d * d / 3.0
                p01 += d * p11 + 0.5 * q * d
                p11 += q
            else:
                p00 += q
        h = z[k]
        v = y[k] - h * a0
        f = h * h * p00 + 1.0
        k0, k1 = p00 * h / f, p01 * h / f
        if store.shape[0] > 0:
            store[k, 0], store[k, 1] = a0, a1
            store[k, 2], store[k, 3], store[k, 4] = p00, p01, p11
            store[k, 5], store[k, 6], store[k, 7], store[k, 8] = v, f, k0, k1
        if h != 0.0:
            log_f += math.log(f)
            squares += v * v / f
            count += 1
            a0 += k0 * v
            a1 += k1 * v
            p11 -= k1 * k1 * f
            p01 = p01 / f
            p00 = p00 / f
    return log_f, squares, count


@compiled()
def _smooth(u, z, store, value, variance):
    """Backward pass: a + P r and P - P N P."""
    r0 = r1 = 0.0
    n00 = n01 = n11 = 0.0
    for k in range(u.size - 1, -1, -1):
        h = z[k]
        p00, p01 = store[k, 2], store[k, 3]
        if k < u.size - 1:  # through the transition [1 d; 0 1]
            d = u[k + 1] - u[k]
            r1 += d * r0
            n11 += 2.0 * d * n01 + d * d * n00
            n01 += d * n00
        if h != 0.0:  # through the update I - K h
            v, f, k0, k1 = store[k, 5], store[k, 6], store[k, 7], store[k, 8]
            l0, l1 = 1.0 - k0 * h, -k1 * h
            m0 = n00 * l0 + n01 * l1
            m1 = n01 * l0 + n11 * l1
            r0 = h * v / f + l0 * r0 + l1 * r1
            n00 = h * h / f + l0 * m0 + l1 * m1
            n01 = m1
        value[k] = store[k, 0] + p00 * r0 + p01 * r1
        w0 = p00 * n00 + p01 * n01
        w1 = p00 * n01 + p01 * n11
        variance[k] = max(p00 - w0 * p00 - w1 * p01, 0.0)


def smooth_parameter(
    u: np.ndarray, z: np.ndarray, y: np.ndarray, nvr: float, order: int = 2
) -> SmoothedParameter:
    """Smooth one parameter on data sorted by u; z is zero at points without an observation."""
    u, z, y = (np.ascontiguousarray(x, dtype=float) for x in (u, z, y))
    store = np.empty((u.size, 9))
    log_f, squares, count = _filter(u, z, y, float(nvr), order, store)
    value, variance = np.empty(u.size), np.empty(u.size)
    _smooth(u, z, store, value, variance)
    freedom = max(count - order, 1)
    return SmoothedParameter(
        value, variance, _concentrated(log_f, squares, freedom), squares / freedom
    )


def nvr_by_likelihood(
    parts: list[tuple[np.ndarray, np.ndarray, np.ndarray]],
    order: int = 2,
    near: float | None = None,
    narrowest: float = NARROWEST,
) -> tuple[float, bool]:
    """NVR of maximum likelihood, noise variance concentrated out, and whether it lies on a bound.

    ``parts`` are sorted (u, z, y) of sets of samples; several likelihoods are added to a composite
    one. On the lower bound the parameter is a constant (order 1) or a straight line (order 2).
    ``near`` limits the search to a decade, ``narrowest`` is the smallest bandwidth as a share of
    the state's range.
    """
    count = max(int(np.count_nonzero(part[1])) for part in parts)
    power = 2.0 * order
    low, high = (-math.log10(max(count, 1)) - power * math.log10(h) for h in (WIDEST, narrowest))

    def cost(exponent: float) -> float:
        """Minus the sum of the log-likelihoods."""
        total = 0.0
        for u, z, y in parts:
            log_f, squares, n = _filter(u, z, y, 10.0**exponent, order, np.empty((0, 9)))
            total -= _concentrated(log_f, squares, max(n - order, 1))
        return total

    grid = np.linspace(low, high, _GRID_POINTS)
    if near is not None:
        middle = math.log10(near)
        grid = np.clip(middle + np.linspace(-1.0, 1.0, 5), low, high)
    best = int(np.argmin([cost(x) for x in grid]))
    if best in (0, len(grid) - 1):
        return 10.0 ** float(grid[best]), bool(grid[best] <= low or grid[best] >= high)
    beside = float(grid[best - 1]), float(grid[best + 1])
    return 10.0 ** lowest(cost, *beside, _TOLERANCE), False


def _concentrated(log_f: float, squares: float, freedom: int) -> float:
    """Log-likelihood at r̂ = Σ v²/F / freedom."""
    r = max(squares / freedom, 1e-300)
    return -0.5 * (freedom * (math.log(2.0 * math.pi * r) + 1.0) + log_f)
