"""The error of a predicted torque: its interval from the scatter over blocks, and its bands.

Errors of neighbouring samples are alike, and parts of a motion are easier or harder to predict.
The blocks of a log are left out in turn (jackknife, Efron and Tibshirani 1993, section 11): with
ℓ = ln(‖e‖/‖τ‖) of all blocks and ℓ_b without block b,

    σ² = (B - 1)/B Σ_b (ℓ_b - mean ℓ_b)²,      interval exp(ℓ ± t σ)

with the quantile t of Student's distribution of B - 1 degrees of freedom. It holds for motion like
that of the log.

The bands are slower than the motion, in its band, and faster. The cosine transform (DCT-II) of a
stretch keeps the sum of squares, and its even continuation has no jump at the ends. So the mean
squares of the bands add up to that of the error.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pivident.validation.held_out.prediction import total_error

#: Fewest and most blocks, and the length that they should have [s].
MIN_BLOCKS, MAX_BLOCKS, BLOCK = 5, 20, 1.0


def block_squares(x: np.ndarray, rate: float) -> np.ndarray:
    """Σ x² in contiguous blocks of equal length, shape (blocks, joints).

    ``x``: shape (samples, joints); ``rate``: of the samples [Hz].
    """
    count = int(np.clip(len(x) / rate / BLOCK, MIN_BLOCKS, MAX_BLOCKS))
    borders = np.linspace(0, len(x), count + 1).astype(int)[:-1]
    return np.add.reduceat(x**2, borders, axis=0)


def joint_intervals(error: np.ndarray, torque: np.ndarray) -> np.ndarray:
    """95 % intervals of 100 ‖e‖/‖τ‖ of each joint [%], shape (joints, 2).

    ``error`` and ``torque``: sums of squares of each block, shape (blocks, joints).
    """
    left_out = np.sqrt(_without_each(error) / np.maximum(_without_each(torque), 1e-300))
    every = np.sqrt(error.sum(axis=0) / np.maximum(torque.sum(axis=0), 1e-300))
    return 100.0 * np.column_stack(_interval(every, left_out))


def total_interval(error: np.ndarray, torque: np.ndarray, units: Sequence[str]) -> np.ndarray:
    """95 % interval of the error over all joints, see `total_error` [%], shape (2,).

    Arguments as of `joint_intervals`; ``units``: of the joints' torques.
    """
    parts = zip(_without_each(error), _without_each(torque), strict=True)
    left_out = np.array([total_error(np.sqrt(e), np.sqrt(t), units) for e, t in parts])
    every = total_error(np.sqrt(error.sum(axis=0)), np.sqrt(torque.sum(axis=0)), units)
    return np.array(_interval(np.array(every), left_out))


def _without_each(squares: np.ndarray) -> np.ndarray:
    """Sums over all blocks but one; rounding cannot make them negative."""
    return np.maximum(squares.sum(axis=0) - squares, 0.0)


def _interval(every: np.ndarray, left_out: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Ends from the value of all blocks, and those with each left out (blocks first)."""
    from scipy.stats import t as student

    count = len(left_out)
    logs = np.log(np.maximum(left_out, 1e-300))
    spread = np.sqrt((count - 1) * logs.var(axis=0))
    factor = np.exp(student.ppf(0.975, count - 1) * spread)
    return every / factor, every * factor


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
