"""Algebraic differentiation: positions, speeds and accelerations as integrals over a window.

    d̂ⁿq/dtⁿ = (2/T)ⁿ ∫ (-1)ⁿ g⁽ⁿ⁾(s) q(t + s T/2) ds,      -1 ≤ s ≤ 1
    g(s)    = (1 - s²)^κ Σ_{i ≤ N} P_i(0) P_i(s) / h_i

with the Jacobi polynomials P_i of exponents κ on both sides and their squared norms h_i (Fliess and
Sira-Ramírez 2003; Mboup, Join and Fliess 2009). g is zero at both ends with its derivatives below
κ, so that integration by parts has moved every derivative from the signal to the kernel: dⁿq/dtⁿ is
projected on polynomials of degree N over the window and read in its middle, and no noise is ever
differentiated. All n share one zero-phase low-pass. With x = π f T and λ = κ + 1/2 its gain is

    G(f) = (2/x)^λ Σ_{m ≤ N/2} (λ + 2m) Γ(λ + m)/m! J_{λ+2m}(x)

By the formula of Rodrigues g⁽ⁿ⁾ is (1 - s²)^(κ-n) times a polynomial of degree N + n. On samples
the estimate is the n-th derivative, in the middle, of the polynomial of degree N + n that fits the
window best with weights (1 - s²)^(κ-n). For such polynomials it is exact; at n = κ the weights are
one, and it is the filter of Savitzky and Golay (1964).

A window that is centred needs the samples after the instant. Behind a running robot the same window
ends at the last sample, and what it estimates was true T/2 ago, whatever the signal.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np

from pivident.foundation.errors import RecordingError


@lru_cache(maxsize=64)
def algebraic_weights(
    half: int, rate: float, derivative: int, degree: int = 2, exponent: float = 4.0
) -> np.ndarray:
    """Weights c of d̂ⁿq/dtⁿ(t_k) = Σ_i c_i q_{k+i}, |i| ≤ half.

    Args:
        half: samples on each side; the window is T = (2 half + 1)/rate.
        rate: sampling rate [Hz].
        derivative: n, from zero to two.
        degree: N, the degree of polynomials that the derivative itself may be.
        exponent: κ, at least the derivative.

    Returns:
        Weights [1/sⁿ], shape (2 half + 1,); not to be written to.

    Raises:
        RecordingError: the window has too few samples for the polynomial.
    """
    from numpy.polynomial import legendre

    fitted = degree + derivative
    if 2 * half < fitted:
        raise RecordingError(
            f"a window of {2 * half + 1} samples at {rate:g} Hz does not determine a polynomial "
            f"of degree {fitted}",
            advice=f"it needs {fitted + 1}: lengthen the window or lower the degree",
        )
    s = np.arange(-half, half + 1) / (half + 0.5)
    root = (1.0 - s**2) ** (0.5 * (exponent - derivative))
    q, r = np.linalg.qr(root[:, None] * legendre.legvander(s, fitted))
    unit = np.eye(fitted + 1)
    middle = [legendre.legval(0.0, legendre.legder(own, derivative)) for own in unit]
    weights = root * (q @ np.linalg.solve(r.T, middle))
    weights *= (rate / (half + 0.5)) ** derivative
    weights.setflags(write=False)
    return weights


def algebraic_derivative(
    x: np.ndarray,
    half: int,
    rate: float,
    derivative: int = 0,
    degree: int = 2,
    exponent: float = 4.0,
) -> np.ndarray:
    """d̂ⁿx/dtⁿ of one signal, in any unit over sⁿ, shape (samples,).

    The ``half`` samples at each end have no whole window and repeat the nearest estimate; for the
    other arguments see `algebraic_weights`.

    Raises:
        RecordingError: the window is longer than the signal.
    """
    from scipy.signal import oaconvolve

    if len(x) <= 2 * half:
        raise RecordingError(
            f"a window of {2 * half + 1} samples is longer than the record of {len(x)}",
            advice="shorten it",
        )
    weights = algebraic_weights(half, rate, derivative, degree, exponent)
    # A constant has no derivative; without it the transforms round less.
    offset = float(np.mean(x))
    inner = oaconvolve(x - offset, weights[::-1], mode="valid")
    return np.pad(inner + (0.0 if derivative else offset), half, mode="edge")


def algebraic_gain(
    frequency: np.ndarray, window: float, degree: int = 2, exponent: float = 4.0
) -> np.ndarray:
    """G(f) that position and derivatives share, shape of ``frequency`` [Hz]; ``window``: T [s]."""
    from scipy.special import gammaln, jv

    x = np.maximum(np.pi * np.abs(np.asarray(frequency, dtype=float)) * window, 1e-3)
    order, gain = exponent + 0.5, np.zeros_like(x)
    for m in range(degree // 2 + 1):
        size = (order + 2 * m) * math.exp(gammaln(order + m) - gammaln(m + 1))
        gain += size * jv(order + 2 * m, x)
    return gain * (2.0 / x) ** order


@lru_cache(maxsize=16)
def half_gain_product(degree: int = 2, exponent: float = 4.0) -> float:
    """F T at which the gain is one half: a window is this over its cut-off frequency."""
    from scipy.optimize import brentq

    def excess(product: float) -> float:
        return float(algebraic_gain(np.array([product]), 1.0, degree, exponent)[0]) - 0.5

    grid = np.arange(0.05, 5.0 * (degree + exponent + 1.0), 0.05)
    below = int(np.argmax([excess(p) < 0.0 for p in grid]))
    return float(brentq(excess, grid[below] - 0.05, grid[below]))


def half_samples(window: float, rate: float, degree: int = 2) -> int:
    """Samples on each side of a window [s], at least those that the degree needs."""
    return max(round(0.5 * (window * rate - 1.0)), (degree + 3) // 2)
