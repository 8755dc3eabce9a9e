"""Likelihood and smoothing of the integrated random walk, compiled.

With D the m-th difference matrix, w = D y, n = samples - m and a diffuse start, a record has the
likelihood of (Harvey and Peters 1990)

    w ~ N(0, r Ω),     Ω = NVR · I + D Dᵀ = RᵀR
    c = R⁻ᵀ w,     r̂ = cᵀc / n,     -2 log L = n (ln 2π r̂ + 1) + ln det Ω

and the smoothed trajectory is T = y - Dᵀ z with R z = c. Two facts make this cheap and exact:

* R is also the triangular factor of the least squares problem min ‖Dᵀz - y‖² + NVR ‖z‖², so
  Givens rotations build it without forming Ω, with rounding errors that grow with the *root* of
  its condition number 4ᵐ/NVR, where a Cholesky factorisation pays the whole of it.
* The rows of R settle, exponentially, on the spectral factor √f0 · θ(z) of Ω. The head of the
  record needs rotations; behind it R is a constant row, c is the recursive filter w / (√f0 θ), and
  an evaluation of the *exact* likelihood costs little more than that filter.

Started at rest instead, the filter would be useless on a record that begins in noise: the error
of the start dies slowly and outweighs the record.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numba import njit

from pivident.signals.random_walk_model import difference_coefficients, nvr_from_f50

#: Smallest NVR at which the smoothed acceleration keeps three digits, by order.
SMALLEST_NVR = {1: 1e-12, 2: 1e-12, 3: 1e-12, 4: 1e-14}

#: Largest NVR of the search: here the smoother passes practically everything.
LARGEST_NVR = 1e4

#: Rows of R are rotated until what is left of the start has decayed to this, and a few more.
_SETTLED = 1e-17
_EXTRA_ROWS = 20

_GRID_POINTS = 24
_TOLERANCE = 1e-3


@dataclass(frozen=True)
class NvrEstimate:
    """Result of the search.

    Attributes:
        nvr: the optimum.
        on_bound: whether it lies on a bound of the search, where it is no interior optimum.
    """

    nvr: float
    on_bound: bool


@dataclass(frozen=True, eq=False)
class DiffuseFit:
    """Smoothed record and exact diffuse likelihood at one NVR.

    Attributes:
        level: smoothed trajectory T, shape (samples,).
        noise_variance: r̂ = wᵀ Ω⁻¹ w / n, with n = samples - m.
        log_likelihood: -n/2 (ln 2π r̂ + 1) - ½ ln det Ω; infinite if the record is a polynomial.
    """

    level: np.ndarray
    noise_variance: float
    log_likelihood: float


def innovations_model(nvr: float, order: int) -> tuple[np.ndarray, float]:
    """Spectral factorisation  NVR + (2 sin(ω/2))²ᵐ = f0 · |θ(e^{-iω})|²  in closed form.

    The 2m roots of the left side come in pairs ζ + 1/ζ = 2 - s with sᵐ = -NVR; those inside the
    unit circle make θ(z) = ∏ (1 - ζ_k z⁻¹).

    Args:
        nvr: noise-to-variance ratio.
        order: order m of the random walk.

    Returns:
        θ, monic, shape (m + 1,), and f0, the innovation variance in units of r.
    """
    roots = _outer_roots(nvr, order)
    return np.real(np.poly(1 / roots)), float(np.real(np.prod(roots)))


def _outer_roots(nvr: float, order: int) -> np.ndarray:
    """The 1/ζ_k outside the unit circle: of each pair the root that forms without cancellation."""
    angles = np.pi * (2 * np.arange(order) + 1) / order
    s = nvr ** (1 / order) * np.exp(1j * angles)
    root = np.sqrt(s * (s - 4))
    candidates = np.array([2 - s + root, 2 - s - root]) / 2
    return candidates[np.argmax(np.abs(candidates), axis=0), np.arange(order)]


def estimate_nvr(
    y: np.ndarray, rate: float, order: int, f50_max: float | None = None, horizon: int = 1
) -> NvrEstimate:
    """NVR by maximum likelihood, or by the smallest errors several steps ahead.

    With the innovations e = √f0 c, the error h steps ahead is Σ_{i<h} ψ_i e_{k-i}, where
    ψ(z) = θ(z) / (1 - z⁻¹)ᵐ: the alternative criterion of the CAPTAIN toolbox. A coarse grid in
    log10 NVR finds the valley, Brent's method its floor.

    Args:
        y: one channel, shape (samples,), contiguous.
        rate: sampling rate [Hz].
        order: order m of the random walk.
        f50_max: largest bandwidth to consider [Hz].
        horizon: number of steps ahead; 1 is maximum likelihood.

    Returns:
        The optimum. A record without visible noise (constant, or a polynomial of degree below m
        up to rounding) gives the upper bound.
    """
    from scipy.optimize import minimize_scalar

    w = np.diff(y, order)
    lower, upper = math.log10(SMALLEST_NVR[order]), math.log10(LARGEST_NVR)
    if f50_max is not None and f50_max < rate / 2:
        upper = max(lower, min(upper, math.log10(nvr_from_f50(f50_max, order, rate))))
    rounding = np.finfo(float).eps * np.max(np.abs(y)) * 2**order
    if np.max(np.abs(w)) <= 2 * rounding:
        return NvrEstimate(10**upper, True)

    def cost(log_nvr: float) -> float:
        factor = _factorise(y, w, 10**log_nvr, order)
        if horizon == 1:
            return -factor.log_likelihood
        error = np.convolve(factor.c, _multi_step_weights(factor.theta, horizon), mode="valid")
        return math.log(factor.f0 * float(error @ error))

    grid = np.linspace(lower, upper, _GRID_POINTS)
    best = int(np.argmin([cost(x) for x in grid]))
    around = (grid[max(best - 1, 0)], grid[min(best + 1, _GRID_POINTS - 1)])
    found = float(minimize_scalar(cost, bounds=around, options={"xatol": _TOLERANCE}).x)
    return NvrEstimate(10**found, min(found - lower, upper - found) <= 2 * _TOLERANCE)


def diffuse_fit(y: np.ndarray, nvr: float, order: int) -> DiffuseFit:
    """Smoothed trajectory and exact likelihood of one channel at a given NVR.

    Args:
        y: one channel, shape (samples,), contiguous.
        nvr: noise-to-variance ratio.
        order: order m of the random walk.
    """
    factor = _factorise(y, np.diff(y, order), nvr, order)
    level = y.copy()
    _substitute(
        difference_coefficients(order),
        factor.head,
        math.sqrt(factor.f0),
        _padded(factor.theta),
        factor.c,
        level,
    )
    return DiffuseFit(level, factor.noise_variance, factor.log_likelihood)


@dataclass(frozen=True, eq=False)
class _Factor:
    """Ω = RᵀR of one record: rows of R until they settle, the settled row, and c = R⁻ᵀ w."""

    head: np.ndarray
    theta: np.ndarray
    f0: float
    c: np.ndarray

    @property
    def noise_variance(self) -> float:
        """r̂ = cᵀc / n."""
        return float(self.c @ self.c) / self.c.size

    @property
    def log_likelihood(self) -> float:
        """log L with r eliminated, infinite for a record without noise."""
        n, settled = self.c.size, self.c.size - len(self.head)
        log_det = 2 * float(np.sum(np.log(self.head[:, 0]))) + settled * math.log(self.f0)
        variance = self.noise_variance
        if variance == 0:
            return math.inf
        return -0.5 * (n * (math.log(2 * math.pi * variance) + 1) + log_det)


def _factorise(y: np.ndarray, w: np.ndarray, nvr: float, order: int) -> _Factor:
    """Rotations over the head of the record, the settled filter over the rest."""
    theta, f0 = innovations_model(nvr, order)
    slowest = np.min(np.abs(_outer_roots(nvr, order)))
    settling = math.ceil(-math.log(_SETTLED) / (2 * math.log(slowest))) + _EXTRA_ROWS
    rows = min(settling, w.size)
    head, c = np.empty((rows, order + 1)), np.empty(w.size)
    _triangularise(
        y[: rows + order], difference_coefficients(order), math.sqrt(nvr), head, c
    )
    _filter_rest(w, 1 / math.sqrt(f0), _padded(theta), rows, c)
    return _Factor(head, theta, f0, c)


def _padded(theta: np.ndarray) -> tuple[float, float, float, float]:
    """θ_1 … θ_4, zero beyond the order: one compiled filter for all orders."""
    t1, t2, t3, t4 = (*theta[1:], 0.0, 0.0, 0.0)[:4]
    return float(t1), float(t2), float(t3), float(t4)


def _multi_step_weights(theta: np.ndarray, horizon: int) -> np.ndarray:
    """ψ_0 … ψ_{h-1} of θ(z) / (1 - z⁻¹)ᵐ: one cumulative sum per order."""
    weights = np.zeros(max(horizon, theta.size))
    weights[: theta.size] = theta
    for _ in range(theta.size - 1):
        weights = np.cumsum(weights)
    return weights[:horizon]


@njit(cache=True, nogil=True)
def _triangularise(y, d, root, factor, rhs):
    """R and Qᵀ(y, 0) of the stacked matrix (Dᵀ; √NVR·I), rows of Dᵀ entering one by one.

    Row i of Dᵀ touches columns i-m … i only. ``factor[j]`` holds R[j, j : j+m+1]; it starts as
    row j of √NVR·I and is final once row j+m has been rotated in. ``rhs`` becomes c. The tuple
    ``d`` makes the bandwidth a constant of the compiled code.
    """
    order = len(d) - 1
    n = y.size - order
    row = np.empty(len(d))
    for i in range(y.size):
        for p in range(len(d)):
            row[p] = d[order - p]
        if i < n:
            factor[i, 0] = root
            factor[i, 1:] = 0.0
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


@njit(cache=True, nogil=True)
def _filter_rest(w, scale, theta, start, c):
    """c_j = w_j / √f0 - Σ θ_t c_{j-t} from j = start on, behind the rows that are there."""
    t1, t2, t3, t4 = theta
    c1 = c[start - 1] if start > 0 else 0.0
    c2 = c[start - 2] if start > 1 else 0.0
    c3 = c[start - 3] if start > 2 else 0.0
    c4 = c[start - 4] if start > 3 else 0.0
    for j in range(start, w.size):
        # c1 enters last: it is the only term that has to wait for the sample before.
        now = (w[j] * scale - t4 * c4 - t3 * c3 - t2 * c2) - t1 * c1
        c[j] = now
        c4, c3, c2, c1 = c3, c2, c1, now


@njit(cache=True, nogil=True)
def _substitute(d, head, root_f0, theta, c, level):
    """Solve R z = c backwards and take Dᵀz off ``level``, which enters as y.

    Behind the head every row of R is √f0 (1, θ_1 … θ_4), and z beyond the last row is zero.
    """
    t1, t2, t3, t4 = theta
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
