"""Likelihood and smoothing of the integrated random walk, compiled.

With D the m-th difference matrix, w = D y, n = samples - m and a diffuse start, a record has the
likelihood of (Harvey and Peters 1990)

    w ~ N(0, r Ω),     Ω = NVR · I + D Dᵀ = RᵀR
    c = R⁻ᵀ w,     r̂ = cᵀc / n,     -2 log L = n (ln 2π r̂ + 1) + ln det Ω

and the smoothed trajectory is T = y - Dᵀ z with R z = c. Two facts make this cheap and exact:

* R is also the triangular factor of the least squares problem min ‖Dᵀz - y‖² + NVR ‖z‖², so
  Givens rotations build it without forming Ω, with rounding errors that grow with the *root* of
  its condition number 4ᵐ/NVR, not with the number itself as in a Cholesky factorisation.
* The rows of R settle, exponentially, on the spectral factor √f0 · θ(z) of Ω. The head of the
  record needs rotations; after it R is a constant row, c is the recursive filter w / (√f0 θ), and
  an evaluation of the *exact* likelihood costs little more than that filter.

Started at rest instead, the filter would be useless on a record that begins in noise: the error
of the start decays slowly and dominates the likelihood.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pivident.foundation.compiled import compiled, inner, section
from pivident.signals.random_walk_model import difference_coefficients, nvr_from_f50

#: Smallest NVR at which the smoothed acceleration keeps about three digits, by order.
MIN_NVR = {1: 1e-8, 2: 1e-10, 3: 1e-12, 4: 1e-14}

#: Largest NVR of the search: here the smoother passes practically everything.
MAX_NVR = 1e4

_GRID_POINTS = 24
_TOLERANCE = 1e-3

#: Rows of R are rotated until the effect of the start has decayed to this, and a few more.
_SETTLED = 1e-17
_EXTRA_ROWS = 20

_GOLDEN = (math.sqrt(5) - 1) / 2


@dataclass(frozen=True)
class NvrEstimate:
    """Optimum of the search, and whether it lies on a bound, not at an interior optimum."""

    nvr: float
    on_bound: bool


@dataclass(frozen=True, eq=False)
class DiffuseFit:
    """Smoothed record T and exact diffuse likelihood at one NVR."""

    level: np.ndarray
    noise_variance: float  # r̂ = wᵀ Ω⁻¹ w / n, n = samples - m
    log_likelihood: float  # -n/2 (ln 2π r̂ + 1) - ½ ln det Ω; infinite for a polynomial


def estimate_nvr(
    y: np.ndarray, rate: float, order: int, f50_max: float | None = None
) -> NvrEstimate:
    """NVR of largest exact likelihood of a channel (samples,), the noise variance r eliminated.

    A coarse grid in log10 NVR brackets the maximum, golden sections refine it to 0.001 decade. A
    record without visible noise (constant, or a polynomial of degree below m up to rounding) gives
    the upper bound.
    """
    w = np.diff(y, order)
    lower, upper = math.log10(MIN_NVR[order]), math.log10(MAX_NVR)
    if f50_max is not None and f50_max < rate / 2:
        upper = max(lower, min(upper, math.log10(nvr_from_f50(f50_max, order, rate))))
    rounding = np.finfo(float).eps * np.max(np.abs(y)) * 2**order
    if np.max(np.abs(w)) <= 2 * rounding:
        return NvrEstimate(10**upper, True)
    grid = np.linspace(lower, upper, _GRID_POINTS)
    best = float(_search(y, w, difference_coefficients(order), grid))
    return NvrEstimate(10**best, min(best - lower, upper - best) <= 2 * _TOLERANCE)


def diffuse_fit(y: np.ndarray, nvr: float, order: int) -> DiffuseFit:
    """Smoothed trajectory and exact likelihood of one channel at a given NVR."""
    return DiffuseFit(*_smooth(y, np.diff(y, order), difference_coefficients(order), nvr))


@compiled()
def spectral_factor(nvr, order):
    """θ, monic, and f0 of  NVR + (2 sin(ω/2))²ᵐ = f0 · |θ(e^{-iω})|²  in closed form.

    The 2m roots of the left side come in pairs ζ + 1/ζ = 2 - s with sᵐ = -NVR; those inside the
    unit circle make θ(z) = ∏ (1 - ζ_k z⁻¹). f0 is the innovation variance in units of r.

    Returns:
        θ padded with zeros to degree four, f0, and the modulus of the slowest root of θ.
    """
    theta, real = np.zeros(5, dtype=np.complex128), np.zeros(5)
    theta[0] = 1.0
    f0, slowest = 1.0 + 0.0j, 0.0
    for k in range(order):
        angle = math.pi * (2 * k + 1) / order
        s = nvr ** (1 / order) * complex(math.cos(angle), math.sin(angle))
        root = np.sqrt(s * (s - 4))
        # The root outside the unit circle is the one that forms without cancellation.
        outer = (2 - s + root) / 2
        if abs(outer) < 1:
            outer = (2 - s - root) / 2
        zeta = 1 / outer
        for i in range(4, 0, -1):  # of slices would be compiled ten times as long
            theta[i] -= zeta * theta[i - 1]
        f0 *= outer
        slowest = max(slowest, abs(zeta))
    for i in range(5):
        real[i] = theta[i].real
    return real, f0.real, slowest


@compiled()
def _search(y, w, d, grid):
    """log10 NVR of largest likelihood: best grid point, then golden sections around it."""
    best, lowest = 0, np.inf
    for i in range(grid.size):
        cost = _cost(y, w, d, grid[i])
        if cost < lowest:
            best, lowest = i, cost
    left, right = grid[max(best - 1, 0)], grid[min(best + 1, grid.size - 1)]
    a, b = right - _GOLDEN * (right - left), left + _GOLDEN * (right - left)
    cost_a, cost_b = _cost(y, w, d, a), _cost(y, w, d, b)
    while right - left > _TOLERANCE:
        if cost_a < cost_b:
            right, b, cost_b = b, a, cost_a
            a = right - _GOLDEN * (right - left)
            cost_a = _cost(y, w, d, a)
        else:
            left, a, cost_a = a, b, cost_b
            b = left + _GOLDEN * (right - left)
            cost_b = _cost(y, w, d, b)
    return (left + right) / 2


@compiled()
def _cost(y, w, d, log_nvr):
    """-log L at one NVR."""
    head, c, _, f0 = _factorise(y, w, d, 10.0**log_nvr)
    return -_likelihood(head, c, f0)[1]


@compiled()
def _smooth(y, w, d, nvr):
    """T, r̂ and log L at one NVR."""
    head, c, theta, f0 = _factorise(y, w, d, nvr)
    variance, log_likelihood = _likelihood(head, c, f0)
    level = y.copy()
    _substitute(d, head, math.sqrt(f0), theta, c, level)
    return level, variance, log_likelihood


@compiled()
def _factorise(y, w, d, nvr):
    """Rows of R until they settle, c = R⁻ᵀ w, and the settled row as θ and f0."""
    order = len(d) - 1
    theta, f0, slowest = spectral_factor(nvr, order)
    settling = math.ceil(math.log(_SETTLED) / (2 * math.log(slowest))) + _EXTRA_ROWS
    rows = int(min(settling, w.size))
    head, c = np.empty((rows, len(d))), np.empty(w.size)
    _triangularise(y, d, math.sqrt(nvr), rows, head, c)
    _filter_rest(w, 1 / math.sqrt(f0), theta, rows, c)
    return head, c, theta, f0


@compiled()
def _likelihood(head, c, f0):
    """r̂ and log L of a factored record; r̂ = 0 means a record without noise."""
    # Four sums, because a single one would depend on itself at every sample.
    s0 = s1 = s2 = s3 = 0.0
    whole = c.size - c.size % 4
    for j in range(0, whole, 4):
        s0 += c[j] ** 2
        s1 += c[j + 1] ** 2
        s2 += c[j + 2] ** 2
        s3 += c[j + 3] ** 2
    for j in range(whole, c.size):
        s0 += c[j] ** 2
    variance = (s0 + s1 + s2 + s3) / c.size
    log_det = (c.size - len(head)) * math.log(f0)
    for j in range(len(head)):
        log_det += 2 * math.log(head[j, 0])
    if variance == 0:
        return 0.0, np.inf
    return variance, -0.5 * (c.size * (math.log(2 * math.pi * variance) + 1) + log_det)


@section
def _triangularise(y, d, root, n, factor, rhs):
    """The first n rows of R and Qᵀ(y, 0) of (Dᵀ; √NVR·I), rows of Dᵀ entering one by one.

    Row i of Dᵀ touches columns i-m … i only. ``factor[j]`` holds R[j, j : j+m+1]; it starts as
    row j of √NVR·I and is final once row j+m has been rotated in. ``rhs`` becomes c. The tuple
    ``d`` makes the bandwidth a constant of the compiled code.
    """
    order = len(d) - 1
    row = np.empty(len(d))
    for i in range(n + order):
        for p in range(len(d)):
            row[p] = d[order - p]
        if i < n:
            factor[i, 0] = root
            for t in range(1, len(d)):
                factor[i, t] = 0.0
            rhs[i] = 0.0
        value = y[i]
        for p in range(len(d)):
            j = i - order + p
            if j < 0 or j >= n:
                continue
            radius = math.sqrt(factor[j, 0] ** 2 + row[p] ** 2)
            cosine, sine = factor[j, 0] / radius, row[p] / radius
            factor[j, 0] = radius
            for t in range(1, len(d) - p):
                upper, lower = factor[j, t], row[p + t]
                factor[j, t] = cosine * upper + sine * lower
                row[p + t] = cosine * lower - sine * upper
            upper, lower = rhs[j], value
            rhs[j] = cosine * upper + sine * lower
            value = cosine * lower - sine * upper


@inner
def _filter_rest(w, scale, theta, start, c):
    """c_j = w_j / √f0 - Σ θ_t c_{j-t} from j = start ≥ 4 on, after the rows of the head."""
    if start == w.size:
        return
    t1, t2, t3, t4 = theta[1], theta[2], theta[3], theta[4]
    c4, c3, c2, c1 = c[start - 4], c[start - 3], c[start - 2], c[start - 1]
    for j in range(start, w.size):
        # c1 enters last: it is the only term that depends on the sample before.
        now = (w[j] * scale - t4 * c4 - t3 * c3 - t2 * c2) - t1 * c1
        c[j] = now
        c4, c3, c2, c1 = c3, c2, c1, now


@section
def _substitute(d, head, root_f0, theta, c, level):
    """Solve R z = c backwards and subtract Dᵀz from ``level``, which enters as y.

    After the head every row of R is √f0 (1, θ_1 … θ_4), and z beyond the last row is zero.
    """
    t1, t2, t3, t4 = theta[1], theta[2], theta[3], theta[4]
    z1 = z2 = z3 = z4 = 0.0
    for j in range(c.size - 1, -1, -1):
        if j >= len(head):
            z = (c[j] / root_f0 - t4 * z4 - t3 * z3 - t2 * z2) - t1 * z1
        else:
            z = c[j]
            later = (z1, z2, z3, z4)
            for t in range(1, len(d)):
                z -= head[j, t] * later[t - 1]
            z /= head[j, 0]
        for t in range(len(d)):
            level[j + t] -= d[t] * z
        z4, z3, z2, z1 = z3, z2, z1, z
