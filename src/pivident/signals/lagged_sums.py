"""Sums over pairs of samples at each lag, by FFT: the unnormalised autocovariance.

Padded with as many zeros as there are lags, the end of a signal does not meet its beginning, and
the inverse transform of its power |X(ω)|² is Σ_i x_i x_{i+k}.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, eq=False)
class LaggedSums:
    """Sums over the pairs of samples at lags 0 … K, each of shape (K + 1,)."""

    products: np.ndarray  # Σ x_i x_{i+k} of the centred signal x
    squares: np.ndarray  # Σ x_i² x_{i+k}²
    pairs: np.ndarray  # n_k, number of pairs


def lagged_products(x: np.ndarray, lags: int, length: int | None = None) -> np.ndarray:
    """Σ_i x_i x_{i+k} for k = 0 … K, shape (K + 1,)."""
    from scipy.fft import irfft, next_fast_len, rfft

    length = next_fast_len(x.size + lags, real=True) if length is None else length
    return irfft(np.abs(rfft(x, length)) ** 2, length)[: lags + 1]


def lagged_sums(pieces: Sequence[np.ndarray], lags: int) -> LaggedSums:
    """Sums over the pairs within each piece, common mean removed; NaN has no pair."""
    apart = np.full(lags, np.nan)  # no lag reaches from one piece into the next
    x = np.concatenate([part for piece in pieces for part in (apart, piece)][1:])
    present = np.isfinite(x)
    x = np.where(present, x - x[present].mean(), 0.0)
    if len(pieces) == 1 and present.all():
        pairs = x.size - np.arange(lags + 1.0)
    else:
        pairs = np.round(lagged_products(present.astype(float), lags))
    return LaggedSums(lagged_products(x, lags), lagged_products(x * x, lags), pairs)
