"""Fewer rows for the same information: a low-pass filter and every n-th sample, block by block.

The motion of a robot, and with it every derivative of its simulation along a parameter, lies at
low frequencies; what was logged lies far above. Weighted means over 4 n samples take the place of
n samples each,

    y_m = Σ_k w_k x_{n m + k},   w_k ∝ 1 - cos(2π (k + ½)/(4 n)),   k = 0 … 4 n - 1

Errors and their derivatives are averaged alike, so that nothing is biased. The window's spectrum is
zero at the new Nyquist frequency and at all further multiples of half of it but zero itself: noise
of high frequencies, which loops amplify, hardly folds back into the motion's band.
"""

from __future__ import annotations

import numpy as np

#: Channels whose means may be compared.
POSITIONS, TORQUES = 0, 1

#: New samples that one mean stretches over.
WIDTH = 4

#: Means that are formed at a time of a whole signal.
PIECE = 1024


class Thinning:
    """Weighted means of signals that come in blocks, time first.

    Args:
        factor: n; 1 leaves all samples as they are.
    """

    def __init__(self, factor: int) -> None:
        self.factor = factor
        self.width = 1 if factor == 1 else WIDTH
        phase = 2.0 * np.pi * (np.arange(self.width * factor) + 0.5) / (self.width * factor)
        weights = np.ones(1) if factor == 1 else (1.0 - np.cos(phase)) / (self.width * factor)
        self._weights = np.ascontiguousarray(weights.reshape(self.width, factor))
        self._open: np.ndarray | None = None  # sums of the means that are not complete yet

    def rows(self, samples: int) -> int:
        """How many means so many samples give."""
        return max(samples // self.factor - self.width + 1, 0)

    def process(self, x: np.ndarray) -> np.ndarray:
        """The means that are complete after the next block.

        ``x``: shape (samples, …), samples a multiple of the factor; result: shape (rows, …).
        """
        if self.factor == 1:
            return x
        chunks = len(x) // self.factor
        flat = x.reshape(chunks, self.factor, -1)
        parts = np.matmul(self._weights, flat)  # (chunks, width, columns)
        if self._open is None:
            self._open = np.full((self.width - 1, flat.shape[2]), np.nan)
        total = np.zeros((chunks + self.width - 1, flat.shape[2]))
        total[: self.width - 1] = self._open
        for place in range(self.width):
            # the mean that begins with chunk m takes weights ``place`` from chunk m + place
            first = self.width - 1 - place
            total[first : first + chunks] += parts[:, place]
        self._open = total[chunks:].copy()
        done = total[:chunks]
        return done[~np.isnan(done[:, :1]).ravel()].reshape(-1, *x.shape[1:])


def passed_power(factor: int, frequency: np.ndarray) -> np.ndarray:
    """What the means leave of a power spectrum.

        (D(x) + ½ D(x - 1/N) + ½ D(x + 1/N))²,   D(x) = sin(π N x)/(N sin(π x)),   N = 4 n

    x is the frequency in cycles per sample; ``frequency``: that in cycles per row, n x.
    """
    from scipy.special import diric

    if factor == 1:
        return np.ones_like(frequency)
    width, x = WIDTH * factor, np.asarray(frequency, dtype=float) / factor
    middle, left, right = (diric(2.0 * np.pi * (x + k / width), width) for k in (0, -1, 1))
    return (middle + 0.5 * left + 0.5 * right) ** 2


def means_at(signal: np.ndarray, factor: int) -> np.ndarray:
    """The means of a whole signal, shape (rows, …)."""
    thinning = Thinning(factor)
    out = np.empty((thinning.rows(len(signal)), *signal.shape[1:]))
    whole, piece, done = len(signal) // factor * factor, PIECE * factor, 0
    for first in range(0, whole, piece):
        part = np.ascontiguousarray(signal[first : min(first + piece, whole)], dtype=float)
        means = thinning.process(part)
        out[done : done + len(means)] = means
        done += len(means)
    return out
