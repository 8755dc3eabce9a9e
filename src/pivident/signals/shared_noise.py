"""Whether two channels of one motion come from one sensor.

What smoothing leaves of a channel is its noise. If one channel was computed from the other, by
whatever filter, its noise is that of the other, filtered. Two sensors have nothing in common.
"""

from __future__ import annotations

import numpy as np

from pivident.signals.random_walk import smooth_channels

#: Samples before and after each one from which its noise is explained.
LAGS = 16


def explained_noise(x: np.ndarray, y: np.ndarray, rate: float) -> np.ndarray:
    """Share of the noise of y that a filter of the noise of x explains, shape (channels,).

    The coefficient of determination, adjusted for the 2·16 + 1 coefficients, of

        e_y(k) = Σ_i b_i e_x(k + i),    i = -16 … 16,

    with e what smoothing at the bandwidth of maximum likelihood leaves. About 0 for two sensors,
    1 for a speed that was computed from its positions; rounding of y and motion that smoothing did
    not take lie in between.

    Args:
        x: samples of one sensor, shape (samples, channels), any unit.
        y: samples of the other, likewise; a position and a speed may be compared.
        rate: sampling rate [Hz].
    """
    left_x, left_y = (signal - smooth_channels(signal, rate).q for signal in (x, y))
    return np.array([_explained(*pair) for pair in zip(left_x.T, left_y.T, strict=True)])


def _explained(x: np.ndarray, y: np.ndarray) -> float:
    """Adjusted share of the variance of y, (samples,), that lags of x explain."""
    lagged = np.lib.stride_tricks.sliding_window_view(x, 2 * LAGS + 1)
    y = y[LAGS : len(y) - LAGS]
    lagged, y = lagged - lagged.mean(axis=0), y - y.mean()
    freedom = len(y) - lagged.shape[1] - 1
    total = float(y @ y)
    if total == 0.0 or freedom < 1:
        return 0.0
    rest = y - lagged @ np.linalg.lstsq(lagged, y, rcond=None)[0]
    return 1.0 - float(rest @ rest) / total * (len(y) - 1) / freedom
