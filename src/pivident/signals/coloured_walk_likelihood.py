"""Likelihood and smoothing of the integrated random walk in coloured measurement noise, compiled.

The measurement is y = T + v with Δᵐ T = η, var η = NVR · r, and ARMA noise a(L) v = √g b(L) ε,
var ε = r, L the lag. Differencing and whitening of the noise remove both memories,

    w = a(L) Δᵐ y = a(L) η + √g b(L) Δᵐ ε  ~ N(0, r Ω),    Ω = NVR · A Aᵀ + C Cᵀ = RᵀR

with A and C the banded Toeplitz matrices of a and of √g b Δᵐ. As for white noise (module
``random_walk_likelihood``, the case a = b = g = 1), but with a wider band, Givens rotations
of the stacked matrix (√NVR Aᵀ; Cᵀ) build R without forming Ω, its rows settle on the spectral
factor of NVR |a|² + g |b|² |Δ|²ᵐ, and after them R⁻ᵀ is a recursive filter. The start of the
trajectory (m numbers) and of the noise (degree of a) is diffuse: w is shorter than y by both.

With z = Ω⁻¹ w the expected disturbances are η̂ = NVR Aᵀ z and ε̂ = Cᵀ z, and the expected noise is
the one sequence with

    a(L) v̂ = √g b(L) ε̂     and     Δᵐ v̂ = Δᵐ y - η̂.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pivident.foundation.compiled import compiled
from pivident.signals.random_walk_likelihood import MAX_NVR, MIN_NVR, DiffuseFit, NvrEstimate
from pivident.signals.random_walk_model import difference_coefficients, nvr_from_f50

_GRID_POINTS = 24
_TOLERANCE = 1e-3
_GOLDEN = (math.sqrt(5) - 1) / 2

#: R has settled when this many consecutive rows differ by less than a tolerance:
#: the search needs the likelihood to 1e-3 only, and narrow lines make R settle slowly.
_SETTLED_ROWS = 10
_SETTLED, _SETTLED_IN_SEARCH = 1e-13, 1e-8

#: Samples from which the start of the noise is computed.
_START = 400


@dataclass(frozen=True, eq=False)
class NoiseColour:
    """ARMA model of measurement noise: a(L) v = √g b(L) ε, var ε = r.

    a and b are monic, roots inside the unit circle, earliest lag first. With r the noise's white
    floor, NVR and half-power frequency mean the same as without colour.
    """

    ar: np.ndarray
    ma: np.ndarray
    gain: float = 1.0  # g, variance of the innovations in units of r

    def spectrum(self, omega: np.ndarray) -> np.ndarray:
        """S_v(ω)/r = g |b|²/|a|², ω in radians per sample."""
        lag = np.exp(-1j * np.asarray(omega))
        ratio = np.polyval(self.ma[::-1], lag) / np.polyval(self.ar[::-1], lag)
        return self.gain * np.abs(ratio) ** 2


def estimate_coloured_nvr(
    y: np.ndarray, rate: float, order: int, colour: NoiseColour, f50_max: float | None = None
) -> NvrEstimate:
    """NVR of largest exact likelihood for noise of a given colour, r eliminated."""
    lower, upper = math.log10(MIN_NVR[order]), math.log10(MAX_NVR)
    if f50_max is not None and f50_max < rate / 2:
        upper = max(lower, min(upper, math.log10(nvr_from_f50(f50_max, order, rate))))
    w, a, c = _banded_system(y, order, colour)
    best = float(_search(w, a, c, np.linspace(lower, upper, _GRID_POINTS)))
    return NvrEstimate(10**best, min(best - lower, upper - best) <= 2 * _TOLERANCE)


def coloured_fit(y: np.ndarray, nvr: float, order: int, colour: NoiseColour) -> DiffuseFit:
    """Smoothed trajectory, r̂ and exact diffuse likelihood of one channel at a given NVR.

    The likelihood is that of w, which is shorter than y by m and the degree of a.
    """
    w, a, c = _banded_system(y, order, colour)
    z, variance, log_likelihood = _solve(w, a, c, nvr)
    disturbance = nvr * np.convolve(z, a)
    innovation = np.convolve(z, c)
    whitened = math.sqrt(colour.gain) * np.convolve(innovation, colour.ma, mode="valid")
    noise = _noise(whitened, np.diff(y, order) - disturbance, colour.ar, order)
    return DiffuseFit(y - noise, variance, log_likelihood)


def _banded_system(
    y: np.ndarray, order: int, colour: NoiseColour
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """w, and the rows of A and C, earliest sample first."""
    d = np.array(difference_coefficients(order))
    w = np.convolve(np.diff(y, order), colour.ar, mode="valid")
    c = math.sqrt(colour.gain) * np.convolve(d, colour.ma[::-1])
    return w, np.ascontiguousarray(colour.ar[::-1], dtype=float), c


def _noise(whitened: np.ndarray, differences: np.ndarray, ar: np.ndarray, order: int) -> np.ndarray:
    """The noise v of a(L) v = ``whitened`` whose start is such that Δᵐ v = ``differences``.

    Both hold exactly for one v. Run from rest, the recursion lacks a free response of a(L), whose
    start follows from the differences of the first samples.
    """
    from scipy.signal import lfilter, lfiltic

    degree = len(ar) - 1
    if degree == 0:
        return whitened

    def run(start: np.ndarray, driven: np.ndarray) -> np.ndarray:
        state = lfiltic([1.0], ar, start[::-1])
        return np.concatenate([start, lfilter([1.0], ar, driven, zi=state)[0]])

    length = min(_START, whitened.size)
    at_rest = run(np.zeros(degree), whitened[:length])
    free = np.array([run(unit, np.zeros(length)) for unit in np.eye(degree)]).T
    missing = differences[: length + degree - order] - np.diff(at_rest, order)
    start = np.linalg.lstsq(np.diff(free, order, axis=0), missing, rcond=None)[0]
    return run(start, whitened)


@compiled()
def _search(w, a, c, grid):
    """log10 NVR of largest likelihood: best grid point, then golden sections around it."""
    head = np.empty((w.size, max(a.size, c.size)))
    best, lowest = 0, np.inf
    for i in range(grid.size):
        cost = _cost(w, a, c, grid[i], head)
        if cost < lowest:
            best, lowest = i, cost
    left, right = grid[max(best - 1, 0)], grid[min(best + 1, grid.size - 1)]
    inner, outer = right - _GOLDEN * (right - left), left + _GOLDEN * (right - left)
    cost_inner, cost_outer = _cost(w, a, c, inner, head), _cost(w, a, c, outer, head)
    while right - left > _TOLERANCE:
        if cost_inner < cost_outer:
            right, outer, cost_outer = outer, inner, cost_inner
            inner = right - _GOLDEN * (right - left)
            cost_inner = _cost(w, a, c, inner, head)
        else:
            left, inner, cost_inner = inner, outer, cost_outer
            outer = left + _GOLDEN * (right - left)
            cost_outer = _cost(w, a, c, outer, head)
    return (left + right) / 2


@compiled()
def _cost(w, a, c, log_nvr, head):
    """-log L at one NVR."""
    rows = _triangularise(a * 10.0 ** (log_nvr / 2), c, head, _SETTLED_IN_SEARCH)
    e = _forward(w, head, rows)
    return -_likelihood(e, head, rows)[1]


@compiled()
def _solve(w, a, c, nvr):
    """Ω⁻¹ w, r̂ and log L at one NVR."""
    head = np.empty((w.size, max(a.size, c.size)))
    rows = _triangularise(a * math.sqrt(nvr), c, head, _SETTLED)
    e = _forward(w, head, rows)
    variance, log_likelihood = _likelihood(e, head, rows)
    _backward(e, head, rows)
    return e, variance, log_likelihood


@compiled()
def _triangularise(a, c, head, tolerance):
    """Rows of R until they settle, ``head[j]`` = R[j, j : j+band+1]; returns their number.

    Row i of Aᵀ (and of Cᵀ) holds a[i - k] in the columns k = i - deg a … i. Rows enter in the
    order of i, so that none fills in beyond column i, and R[j] is final after row j + band.
    """
    n, band = head.shape[0], head.shape[1] - 1
    row = np.empty(band + 1)
    settled = 0
    for i in range(n + band):
        if i < n:
            head[i] = 0.0
        for part in range(2):
            values = a if part == 0 else c
            length = values.size - 1
            for p in range(length + 1):
                row[p] = values[length - p]
            for p in range(length + 1):
                j = i - length + p
                if j < 0 or j >= n or row[p] == 0.0:
                    continue
                radius = math.sqrt(head[j, 0] ** 2 + row[p] ** 2)
                cosine, sine = head[j, 0] / radius, row[p] / radius
                head[j, 0] = radius
                for t in range(1, length + 1 - p):
                    upper, lower = head[j, t], row[p + t]
                    head[j, t] = cosine * upper + sine * lower
                    row[p + t] = cosine * lower - sine * upper
        j = i - band
        if j >= 1:
            change = 0.0
            for t in range(band + 1):
                change = max(change, abs(head[j, t] - head[j - 1, t]))
            settled = settled + 1 if change < tolerance * head[j, 0] else 0
            if settled == _SETTLED_ROWS:
                return j + 1
    return n


@compiled()
def _forward(w, head, rows):
    """Solve Rᵀ e = w; from row ``rows`` on R is a constant row."""
    band = head.shape[1] - 1
    e = np.empty(w.size)
    for j in range(min(rows + band, w.size)):
        now = w[j]
        for t in range(1, min(band, j) + 1):
            now -= head[min(j - t, rows - 1), t] * e[j - t]
        e[j] = now / head[min(j, rows - 1), 0]
    scale = 1.0 / head[rows - 1, 0]
    theta = head[rows - 1] * scale
    for j in range(rows + band, w.size):
        now = w[j] * scale
        # The sample before enters last: only this term depends on the previous step.
        for t in range(band, 0, -1):
            now -= theta[t] * e[j - t]
        e[j] = now
    return e


@compiled()
def _likelihood(e, head, rows):
    """r̂ = eᵀe/n and log L = -½ (n (ln 2π r̂ + 1) + ln det Ω)."""
    log_det = 2.0 * (e.size - rows) * math.log(head[rows - 1, 0])
    for j in range(rows):
        log_det += 2.0 * math.log(head[j, 0])
    variance = np.dot(e, e) / e.size
    if variance == 0.0:
        return 0.0, np.inf
    return variance, -0.5 * (e.size * (math.log(2 * math.pi * variance) + 1) + log_det)


@compiled()
def _backward(z, head, rows):
    """Solve R z = e in place of e."""
    band = head.shape[1] - 1
    for j in range(z.size - 1, -1, -1):
        row = min(j, rows - 1)
        now = z[j]
        for t in range(min(band, z.size - 1 - j), 0, -1):
            now -= head[row, t] * z[j + t]
        z[j] = now / head[row, 0]
