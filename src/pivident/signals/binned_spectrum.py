"""Spectra of positions: a periodogram, merged into bins, and the background of its narrow lines.

A position's spectrum falls over many decades. Its m-th difference is flat enough for the transform
of a whole record with Hann's window, and the differences are divided out of the periodogram. The
running median over the bins is the background of narrow lines: it is robust to outliers, and on a
slope it is the value in the middle, however steep.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

#: Maximum number of bins of the spectrum in which narrow lines are searched.
_BINS = 2048

#: Bins per octave of the spectrum in which wide lines are searched.
_PER_OCTAVE = 24

#: Minimum number of periodogram samples in one bin: fewer are too erratic.
_MERGED = 8

#: Half length of the running median: as a fraction of the bins (37 Hz at 5 kHz), in octaves.
_NARROW, _WIDE = 0.015, 1.0

#: Samples of a periodogram below which lines are indistinguishable from chance.
MIN_SAMPLES = 4096

#: Rounds of dividing lines out of the spectrum.
_ROUNDS = 3


def tapered_periodogram(y: np.ndarray, rate: float, order: int) -> tuple[np.ndarray, np.ndarray]:
    """Frequencies above zero [Hz] and |FFT of the tapered m-th difference|² / (2 sin(ω/2))²ᵐ.

    White noise has its variance at all frequencies.
    """
    from scipy.fft import rfft

    taper, omega, scale = _transform(y.size, order)
    length = round(2.0 * np.pi / omega[0])
    transformed = rfft(np.diff(y, order) * taper, length)[1:]
    power = transformed.real**2 + transformed.imag**2
    return omega * rate / (2.0 * np.pi), power * scale


@lru_cache(maxsize=1)
def _transform(samples: int, order: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Hann's window, angular frequencies, periodogram factors: the same for all channels."""
    from scipy.fft import next_fast_len

    size = samples - order
    taper = 0.5 - 0.5 * np.cos(2.0 * np.pi * (np.arange(size) + 0.5) / size)
    length = next_fast_len(size, real=True)
    omega = 2.0 * np.pi * np.arange(1, length // 2 + 1) / length
    scale = (2.0 * np.sin(omega / 2.0)) ** (-2 * order) / np.dot(taper, taper)
    return taper, omega, scale


@dataclass(frozen=True, eq=False)
class Bins:
    """A spectrum in bins."""

    centre: np.ndarray  # mean frequency of each bin [Hz]
    spectrum: np.ndarray  # mean of the periodogram over it
    half: int  # half length of a bin's neighbourhood, in bins

    def background(self, total: np.ndarray | None = None) -> np.ndarray:
        """Running median below lines of a given ``total`` spectrum S at the bins.

        The skirts of a strong line raise the median around it. The spectrum less the model of the
        lines, spectrum · B/(B + S), has the background's level again, slope included.
        """
        from scipy.ndimage import median_filter

        length = 2 * self.half + 1
        level = median_filter(self.spectrum, length, mode="nearest")
        if total is not None:
            for _ in range(_ROUNDS):
                cleaned = self.spectrum * level / (level + total)
                level = median_filter(cleaned, length, mode="nearest")
        return level

    def around(self, i: int) -> tuple[float, float]:
        """Ends of the neighbourhood of bin ``i`` [Hz]."""
        last = self.centre.size - 1
        return self.centre[max(i - self.half, 0)], self.centre[min(i + self.half, last)]

    def width(self, i: int) -> float:
        """Width of bin ``i`` [Hz]."""
        i = min(i, self.centre.size - 2)
        return float(self.centre[i + 1] - self.centre[i])


def even_bins(frequency: np.ndarray, periodogram: np.ndarray) -> Bins:
    """Bins of equal width."""
    merged = max(_MERGED, len(periodogram) // _BINS)
    count = len(periodogram) // merged
    centre, spectrum = (
        x[: count * merged].reshape(count, merged).mean(axis=1) for x in (frequency, periodogram)
    )
    return Bins(centre, spectrum, max(10, round(_NARROW * count)))


def octave_bins(frequency: np.ndarray, periodogram: np.ndarray, lowest: float) -> Bins:
    """Bins whose width grows with the frequency, from where enough samples fall into one.

    The neighbourhood of ``lowest`` [Hz] is complete.
    """
    growth = 2.0 ** (1.0 / _PER_OCTAVE)
    enough = _MERGED * (frequency[1] - frequency[0]) / (growth - 1.0)
    lowest = max(lowest * 2.0**-_WIDE, enough)
    octaves = math.log2(frequency[-1] / lowest)
    edges = lowest * growth ** np.arange(int(octaves * _PER_OCTAVE) + 1)
    first = np.searchsorted(frequency, edges)
    count = np.diff(first)
    centre, spectrum = (np.add.reduceat(x, first)[:-1] / count for x in (frequency, periodogram))
    return Bins(centre, spectrum, round(_WIDE * _PER_OCTAVE))
