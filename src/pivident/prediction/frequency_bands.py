"""The error of a predicted torque by frequency: slower than the motion, in its band, and faster.

The cosine transform (DCT-II) of a stretch keeps the sum of squares, and its even continuation has
no jump at the ends. So the mean squares of the bands add up to that of the error.
"""

from __future__ import annotations

import numpy as np

#: Share of the joints' squared speeds that lies below the band of the motion.
SLOWER = 0.05


def motion_band_start(dq: np.ndarray, rate: float, stop: float) -> float:
    """Frequency below which 5 % of the squared speeds lie, each joint with the same weight [Hz].

    ``dq``: shape (samples, joints) [rad/s or m/s]; ``stop``: end of the band [Hz].
    """
    power = _spectrum(dq)
    share = (power / np.maximum(power.sum(axis=0), 1e-300)).sum(axis=1).cumsum()
    k = int(np.searchsorted(share, SLOWER * share[-1]))
    return min(float(f"{frequencies(len(dq), rate)[k]:.1g}"), stop)


def rms_by_band(x: np.ndarray, rate: float, edges: tuple[float, float]) -> np.ndarray:
    """Rms below, between and above two frequencies, shape (3, joints).

    ``x``: shape (samples, joints); ``edges``: [Hz].
    """
    power = _spectrum(x)
    band = np.searchsorted(np.asarray(edges), frequencies(len(x), rate), side="right")
    return np.sqrt([power[band == k].sum(axis=0) for k in range(3)])


def frequencies(samples: int, rate: float) -> np.ndarray:
    """Frequency of each coefficient [Hz], shape (samples,)."""
    return 0.5 * rate * np.arange(samples) / samples


def _spectrum(x: np.ndarray) -> np.ndarray:
    """Mean square of each coefficient; they sum up to that of the signal."""
    from scipy.fft import dct

    return dct(x, axis=0, norm="ortho") ** 2 / len(x)
