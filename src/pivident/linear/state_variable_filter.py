"""The state-variable filter: derivatives of sampled signals, all filtered by 1/A(p).

A continuous-time model needs derivatives that were never measured. Filtered by 1/A of order n
they are the states of one chain in controllable canonical form, (C2),

    Ẋ = A_c X + e_1 v(t),     X = (p^(n-1), …, p, 1)ᵀ/A(p) v,     p^n/A v = v - Σ_i a_i X_i

which is discretised exactly for the behaviour of v between its samples (Van Loan, 1978):

    X_{k+1} = Φ X_k + Γ_0 v_k + Γ_1 v_{k+1},      Γ_1 = 0 with a zero-order hold.

The recursion runs on the states, not on the polynomial det(zI - Φ): with fast sampling that
polynomial has n zeros close to z = 1, and its direct form loses (ω dt)^-n in accuracy.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from pivident.linear.model import Hold

#: States that the recursion sums in parallel.
_LANES = 4

#: 0.5^15 / 15! is 2e-17.
_TAYLOR_TERMS = 15


def filtered_derivatives(
    signal: np.ndarray, denominator: np.ndarray, dt: float, hold: Hold
) -> np.ndarray:
    """p^n/A v, …, p/A v, 1/A v from rest, shape (n + 1, samples); A highest power first."""
    signal = np.ascontiguousarray(signal, dtype=float)
    order = len(denominator) - 1
    out = np.empty((order + 1, signal.size))
    if order == 0:
        out[0] = signal
        return out
    phi, now, ahead, units = discretised_chain(denominator, dt, hold)
    padded = -(-order // _LANES) * _LANES
    columns = np.zeros((order + 2, padded))
    columns[:order, :order] = phi.T
    columns[order, :order], columns[order + 1, :order] = now, ahead
    _run(columns, units, np.asarray(denominator[1:], dtype=float), signal, out)
    return out


def discretised_chain(
    denominator: np.ndarray, dt: float, hold: Hold
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Φ, Γ_0, Γ_1 of the chain in normalised frequency, and the units of its states.

    With p = ω p' and ω = max |a_i|^(1/i) no entry of the companion matrix exceeds one; the states
    of (C2) are ``units`` times the normalised ones.
    """
    order = len(denominator) - 1
    powers = np.arange(1, order + 1)
    a = np.asarray(denominator[1:], dtype=float)
    omega = float(np.max(np.abs(a) ** (1.0 / powers))) or 1.0 / dt
    block = np.zeros((order + 2, order + 2))
    block[0, :order] = -a / omega**powers
    block[np.arange(1, order), np.arange(order - 1)] = 1.0
    block[0, order] = 1.0
    block[:order] *= omega * dt
    block[order, order + 1] = 1.0
    exponential = small_exponential(block)
    phi = np.ascontiguousarray(exponential[:order, :order])
    first, ramp = exponential[:order, order].copy(), exponential[:order, order + 1].copy()
    if hold == "zoh":
        return phi, first, np.zeros(order), omega ** -powers.astype(float)
    return phi, first - ramp, ramp, omega ** -powers.astype(float)


@njit(cache=True, nogil=True)
def small_exponential(matrix):
    """exp(M) of a few rows: Taylor series of M/2^s with norm below 1/2, squared s times.

    As accurate as ``scipy.linalg.expm`` at these sizes, which starts the threads of a BLAS for six
    rows: milliseconds on a busy machine, for every iterate.
    """
    size = len(matrix)
    norm = np.abs(matrix).sum(axis=1).max()
    halvings = 0
    while norm > 0.5 and halvings < 1000:
        norm *= 0.5
        halvings += 1
    scaled = matrix * 0.5**halvings
    total = np.eye(size)
    for term in range(_TAYLOR_TERMS, 0, -1):
        total = _product(scaled, total) / term
        for i in range(size):
            total[i, i] += 1.0
    for _ in range(halvings):
        total = _product(total, total)
    return total


@njit(cache=True, nogil=True)
def _product(a, b):
    """A B, without a BLAS."""
    size = len(a)
    out = np.zeros((size, size))
    for i in range(size):
        for k in range(size):
            for j in range(size):
                out[i, j] += a[i, k] * b[k, j]
    return out


@njit(cache=True, nogil=True, fastmath={"contract", "reassoc"})
def combined(weights, rows):
    """Σ_i w_i rows_i, shape (samples,); too small a product for the threads of a BLAS."""
    total = weights[0] * rows[0]
    for i in range(1, weights.size):
        for k in range(total.size):
            total[k] += weights[i] * rows[i, k]
    return total


@njit(cache=True, nogil=True, fastmath={"contract"})
def _run(columns, units, denominator, signal, out):
    """The recursion from X_0 = 0, into out (order + 1, samples), highest derivative first.

    ``columns`` holds the columns of Φ, then Γ_0 and Γ_1, padded with zeros to whole lanes: four
    states are summed at a time, which the compiler keeps in one register.
    """
    order, samples = units.size, signal.size
    padded = columns.shape[1]
    state, following = np.zeros(padded), np.zeros(padded)
    for k in range(samples):
        highest = signal[k]
        for i in range(order):
            value = units[i] * state[i]
            out[i + 1, k] = value
            highest -= denominator[i] * value
        out[0, k] = highest
        if k + 1 == samples:
            break
        now, ahead = signal[k], signal[k + 1]
        for i in range(0, padded, _LANES):
            s0 = columns[order, i] * now + columns[order + 1, i] * ahead
            s1 = columns[order, i + 1] * now + columns[order + 1, i + 1] * ahead
            s2 = columns[order, i + 2] * now + columns[order + 1, i + 2] * ahead
            s3 = columns[order, i + 3] * now + columns[order + 1, i + 3] * ahead
            for j in range(order):
                x = state[j]
                s0 += columns[j, i] * x
                s1 += columns[j, i + 1] * x
                s2 += columns[j, i + 2] * x
                s3 += columns[j, i + 3] * x
            following[i], following[i + 1], following[i + 2], following[i + 3] = s0, s1, s2, s3
        for i in range(padded):
            state[i] = following[i]
