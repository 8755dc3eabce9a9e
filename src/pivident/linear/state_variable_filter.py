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

from pivident.foundation.compiled import compiled
from pivident.linear.model import Hold

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
    chain = discretised_chain(denominator, dt, hold)
    _run(*chain, np.asarray(denominator[1:], dtype=float), signal, out)
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


@compiled()
def small_exponential(matrix):
    """exp(M) of a few rows: Taylor series of M/2^s with norm below 1/2, squared s times.

    As accurate as ``scipy.linalg.expm`` at these sizes, which starts the threads of a BLAS for six
    rows: milliseconds on a busy machine, for every iterate.
    """
    size = len(matrix)
    norm = 0.0
    for i in range(size):
        row = 0.0
        for j in range(size):
            row += abs(matrix[i, j])
        norm = max(norm, row)
    halvings, scale = 0, 1.0
    while norm > 0.5 and halvings < 1000:
        norm *= 0.5
        scale *= 0.5
        halvings += 1
    scaled, total = np.empty((size, size)), np.zeros((size, size))
    for i in range(size):
        total[i, i] = 1.0
        for j in range(size):
            scaled[i, j] = matrix[i, j] * scale
    for term in range(_TAYLOR_TERMS, 0, -1):
        total = _product(scaled, total)
        for i in range(size):
            for j in range(size):
                total[i, j] /= term
            total[i, i] += 1.0
    for _ in range(halvings):
        total = _product(total, total)
    return total


@compiled()
def _product(a, b):
    """A B, without a BLAS."""
    size = len(a)
    out = np.zeros((size, size))
    for i in range(size):
        for k in range(size):
            for j in range(size):
                out[i, j] += a[i, k] * b[k, j]
    return out


@compiled(fastmath={"contract", "reassoc"})
def combined(weights, rows):
    """Σ_i w_i rows_i, shape (samples,); too small a product for the threads of a BLAS."""
    total = weights[0] * rows[0]
    for i in range(1, weights.size):
        for k in range(total.size):
            total[k] += weights[i] * rows[i, k]
    return total


@compiled(fastmath={"contract"})
def _run(phi, now, ahead, units, denominator, signal, out):
    """The recursion from X_0 = 0, into out (order + 1, samples), highest derivative first.

    What the signal adds, and the units, need no recursion: they are taken for many samples at once.
    Of one or two states the recursion stays in registers.
    """
    order, samples = units.size, signal.size
    for i in range(order):
        out[i + 1, 0] = 0.0
        for k in range(samples - 1):
            out[i + 1, k + 1] = now[i] * signal[k] + ahead[i] * signal[k + 1]
    if order == 1:
        x = 0.0
        for k in range(1, samples):
            x = out[1, k] + phi[0, 0] * x
            out[1, k] = x
    elif order == 2:
        a, b, c, d = phi[0, 0], phi[0, 1], phi[1, 0], phi[1, 1]
        x, y = 0.0, 0.0
        for k in range(1, samples):
            x, y = out[1, k] + a * x + b * y, out[2, k] + c * x + d * y
            out[1, k], out[2, k] = x, y
    else:
        for k in range(1, samples):
            for i in range(order):
                for j in range(order):
                    out[i + 1, k] += phi[i, j] * out[j + 1, k - 1]
    for k in range(samples):
        out[0, k] = signal[k]
    for i in range(order):
        for k in range(samples):
            out[i + 1, k] *= units[i]
            out[0, k] -= denominator[i] * out[i + 1, k]
