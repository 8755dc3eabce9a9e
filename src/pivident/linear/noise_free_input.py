"""Inputs of a closed loop without the noise that the loop feeds back.

In a loop the input u = S r - C S ξ carries the output's noise ξ, and instruments computed from it
are correlated with ξ. The first stage of the two-stage method (Van den Hof and Schrama, 1993)
keeps the part that the external signals r explain,

    û = Σ_k c_k L_k(z) r,     L_k(z) = √(1 - a²)/(z - a) ((1 - a z)/(z - a))^(k-1)

on Laguerre functions and a direct term: linear in c, always stable, and the orders are nested,
so that one Cholesky factorisation gives the BIC of all of them. The pole a is searched on a grid.
Estimates are consistent for any û that depends on r alone; a good û makes them precise.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from scipy.signal import lfilter

from pivident.linear.state_variable_filter import combined

#: Maximum number of Laguerre functions for each external signal.
_FUNCTIONS = 24

#: Poles tried: time constants of the loop, logarithmically spaced [samples].
_TIME_CONSTANTS = np.geomspace(2.0, 1000.0, 12)

#: Regularisation of linearly dependent functions, relative to their energy.
_RIDGE = 1e-10

#: Samples per block of a sum.
_STRETCH = 512


def noise_free_inputs(u: np.ndarray, external: np.ndarray) -> np.ndarray:
    """û (samples, inputs) from u (samples, inputs) and r (samples, signals)."""
    samples, inputs = u.shape
    best = np.full(inputs, np.inf)
    found = np.zeros_like(u)
    energy = np.sum(u**2, axis=0)
    for constant in _TIME_CONSTANTS[_TIME_CONSTANTS <= samples / 4]:
        basis = _laguerre(external, np.exp(-1.0 / constant), min(_FUNCTIONS, samples // 20))
        functions = len(basis)
        moments = _moments(np.concatenate([basis, u.T]))
        gram = moments[:functions, :functions]
        gram[np.diag_indices(functions)] *= 1.0 + _RIDGE
        factor = np.linalg.cholesky(gram)
        scores = np.linalg.solve(factor, moments[:functions, functions:])
        left = np.maximum(energy - np.cumsum(scores**2, axis=0), 1e-14 * energy)
        size = np.arange(1, functions + 1)[:, None]
        bic = samples * np.log(left / samples) + np.log(samples) * size
        for i, order in enumerate(np.argmin(bic, axis=0)):
            if bic[order, i] < best[i]:
                best[i] = bic[order, i]
                kept = slice(0, int(order) + 1)
                weights = np.linalg.solve(factor[kept, kept].T, scores[kept, i])
                found[:, i] = combined(weights, basis[kept])
    return found


def _laguerre(external: np.ndarray, a: float, functions: int) -> np.ndarray:
    """Rows r, L_1 r, L_2 r, … of all external signals, by order."""
    rows = [external.T]
    state = lfilter([0.0, np.sqrt(1 - a * a)], [1.0, -a], external.T)
    for _ in range(functions):
        rows.append(state)
        state = lfilter([-a, 1.0], [1.0, -a], state)
    return np.concatenate(rows)


@njit(cache=True, nogil=True, fastmath={"contract", "reassoc"})
def _moments(rows):
    """Σ_k v_ik v_jk of all pairs of rows, in stretches that stay in the cache."""
    size, samples = rows.shape
    out = np.zeros((size, size))
    for start in range(0, samples, _STRETCH):
        stop = min(start + _STRETCH, samples)
        for i in range(size):
            for j in range(i + 1):
                total = 0.0
                for k in range(start, stop):
                    total += rows[i, k] * rows[j, k]
                out[i, j] += total
    for i in range(size):
        for j in range(i):
            out[j, i] = out[i, j]
    return out
