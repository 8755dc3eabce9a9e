"""Lines in the spectrum of an encoder's noise, distinguished from the motion by their width.

Above the motion's band the spectrum of a measured position falls to the floor of the noise and
does not rise again, unless the noise is coloured. A line (an interpolation error, a mechanical
resonance, mains) stands out from the running median of its neighbourhood, which follows a slope of
any steepness without bias. A line as wide as the motion's own slope is indistinguishable from
motion this way: wide lines are searched where motion has ended.

A line is modelled as an AR(2) process. Its spectrum near the peak is Lorentz's curve

    S(f) = peak / (1 + ((f - f0)/width)²),    variance = 2π · width · peak / rate

whose three numbers maximise the likelihood of the periodogram (Whittle 1953), with exponentially
distributed bins P_k:

    -log L = Σ_k ln(B_k + S(f_k)) + P_k / (B_k + S(f_k)),    B the background.

Spectra of positions: a periodogram, merged into bins, and the background of its narrow lines.

A position's spectrum falls over many decades. Its m-th difference is flat enough for the transform
of a whole record with Hann's window, and the differences are divided out of the periodogram. The
running median over the bins is the background of narrow lines: it is robust to outliers, and on a
slope it is the value in the middle, however steep.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from pivident.signals.bandpass import median_filter
from pivident.signals.coloured_walk_likelihood import NoiseColour
from pivident.signals.filters import fast_length

#: Lowest frequency of a narrow line [Hz]: below, periodic motion has lines of its own.
LOWEST_FREQUENCY = 40.0
#: Lowest frequency of a wide line [Hz]: below, the machine's own vibrations look like one.
LOWEST_WIDE_FREQUENCY = 80.0
#: Maximum number of peaks of a channel: a spectrum with more is a comb of periodic motion.
MAX_LINES = 4
#: Minimum number of bins between two peaks: the spectrum of a single line is ragged.
_GAP = 4
#: Independent samples per sample of a periodogram with Hann's window.
_INDEPENDENT = 2.0 / 3.0
#: Smallest ratio of a peak to its neighbourhood. Chance does not reach it (the largest of 300
#: white records was 5.9), and weaker lines hardly change the smoother. Where the neighbourhood is
#: _MOTION times the floor, narrow peaks must be higher: the last lobes of motion reach 12.
_SMALLEST_PEAK, _SMALLEST_ON_MOTION, _MOTION = 10.0, 20.0, 3.0
#: Widest line, as a fraction of the half length: anything wider is no line of that neighbourhood.
_WIDEST = 0.4
#: Rounds of fitting a line and its background in turn, and steps of a fit.
_ROUNDS = 3
_STEPS = 30
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
_BACKGROUND_ROUNDS = 3


@dataclass(frozen=True)
class SpectralLine:
    """One line of a noise spectrum."""

    frequency: float  # of the peak [Hz]
    width: float  # half width at half height [Hz]
    std: float  # standard deviation of the noise in the line [rad or m]

    def peak(self, rate: float) -> float:
        """Spectrum at the peak, in units in which white noise has its variance everywhere."""
        return self.std**2 * rate / (2.0 * math.pi * self.width)

    def spectrum(self, frequency: np.ndarray, rate: float) -> np.ndarray:
        """Lorentz's curve at the frequencies [Hz], same units."""
        return self.peak(rate) / (1.0 + ((frequency - self.frequency) / self.width) ** 2)

    def autoregressive(self, rate: float) -> tuple[np.ndarray, float]:
        """AR(2) model: its monic polynomial and the variance of its innovations."""
        radius = math.exp(-2.0 * math.pi * self.width / rate)
        angle = 2.0 * math.pi * self.frequency / rate
        a = np.array([1.0, -2.0 * radius * math.cos(angle), radius**2])
        a1, a2 = a[1:]
        gain = (1.0 + a2) / ((1.0 - a2) * ((1.0 + a2) ** 2 - a1**2))
        return a, self.std**2 / gain


@dataclass(frozen=True)
class LineSearch:
    """Lines of a channel, the strongest first, and the white floor: the level of its upper half."""

    lines: tuple[SpectralLine, ...]
    floor: float  # variance, in squared units of the channel


def tapered_periodogram(y: np.ndarray, rate: float, order: int) -> tuple[np.ndarray, np.ndarray]:
    """Frequencies above zero [Hz] and |FFT of the tapered m-th difference|² / (2 sin(ω/2))²ᵐ.

    White noise has its variance at all frequencies.
    """
    taper, omega, scale = _transform(y.size, order)
    length = round(2.0 * np.pi / omega[0])
    transformed = np.fft.rfft(np.diff(y, order) * taper, length)[1:]
    power = transformed.real**2 + transformed.imag**2
    return omega * rate / (2.0 * np.pi), power * scale


@lru_cache(maxsize=1)
def _transform(samples: int, order: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Hann's window, angular frequencies, periodogram factors: the same for all channels."""
    size = samples - order
    taper = 0.5 - 0.5 * np.cos(2.0 * np.pi * (np.arange(size) + 0.5) / size)
    length = fast_length(size)
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
        length = 2 * self.half + 1
        level = median_filter(self.spectrum, length)
        if total is not None:
            for _ in range(_BACKGROUND_ROUNDS):
                level = median_filter(self.spectrum * level / (level + total), length)
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


def find_lines(y: np.ndarray, rate: float, order: int) -> LineSearch:
    """Lines of one channel, first the narrow ones, then the wide ones."""
    frequency, periodogram = tapered_periodogram(y, rate, order)
    if len(periodogram) < MIN_SAMPLES or not np.all(periodogram > 0.0):
        return LineSearch((), 0.0)
    even = even_bins(frequency, periodogram)
    background = even.background()
    upper = slice(even.centre.size // 2, int(0.9 * even.centre.size))
    floor = float(np.median(background[upper]))
    smallest = np.where(background < _MOTION * floor, _SMALLEST_PEAK, _SMALLEST_ON_MOTION)
    lines: list[SpectralLine] = []
    comb = _search(even, LOWEST_FREQUENCY, smallest, lines, frequency, periodogram, rate)
    if not comb and rate > 8.0 * LOWEST_WIDE_FREQUENCY:
        wide = octave_bins(frequency, periodogram, LOWEST_WIDE_FREQUENCY)
        lowest, smallest = LOWEST_WIDE_FREQUENCY, np.full(wide.centre.size, _SMALLEST_PEAK)
        _search(wide, lowest, smallest, lines, frequency, periodogram, rate)
    lines.sort(key=lambda line: -line.std)
    left = even.spectrum[upper] - _total(lines, even.centre[upper], rate)
    return LineSearch(tuple(lines), float(np.median(left)))


def noise_colour(found: LineSearch, rate: float) -> NoiseColour:
    """ARMA model of a white floor r and lines.

    With a the product of the lines' polynomials, b is the spectral factor of the numerator,

        g |b|² = |a|² + Σ_i (s_i/r) Π_{j≠i} |a_j|².
    """
    parts = [line.autoregressive(rate) for line in found.lines]
    ar = np.ones(1)
    for a, _ in parts:
        ar = np.convolve(ar, a)
    numerator = np.convolve(ar, ar[::-1])
    for i, (_, variance) in enumerate(parts):
        others = np.ones(1)
        for j, (a, _) in enumerate(parts):
            if j != i:
                others = np.convolve(others, a)
        numerator[2:-2] += variance / found.floor * np.convolve(others, others[::-1])
    roots = np.roots(numerator)
    inside = roots[np.argsort(np.abs(roots))][: len(ar) - 1]
    ma = np.atleast_1d(np.real(np.poly(inside)))
    return NoiseColour(ar, ma, float(numerator[len(ar) - 1] / np.dot(ma, ma)))


def _search(
    bins: Bins,
    lowest: float,
    smallest: np.ndarray,
    lines: list[SpectralLine],
    frequency: np.ndarray,
    periodogram: np.ndarray,
    rate: float,
) -> bool:
    """Add the lines ``smallest`` times above the background; True: the spectrum is a comb."""
    searched = (bins.centre > lowest) & (bins.centre < bins.centre[-1 - bins.half])
    background = bins.background(_total(lines, bins.centre, rate) if lines else None)
    above = np.flatnonzero(searched & (bins.spectrum > smallest * background))
    if above.size and 1 + np.count_nonzero(np.diff(above) > _GAP) > MAX_LINES:
        return True
    for _ in range(MAX_LINES):
        total = _total(lines, bins.centre, rate)
        ratio = np.where(searched, bins.spectrum / (background + total) / smallest, 0.0)
        highest = int(np.argmax(ratio))
        if ratio[highest] < 1.0:
            break
        found = _measure(highest, bins, lines, frequency, periodogram, rate)
        if found is None:
            searched[max(highest - bins.half, 0) : highest + bins.half] = False
        else:
            lines.append(found)
            background = bins.background(_total(lines, bins.centre, rate))
    return False


def _total(lines: Sequence[SpectralLine], frequency: np.ndarray, rate: float) -> np.ndarray:
    total = np.zeros(len(frequency))
    for line in lines:
        total += line.spectrum(frequency, rate)
    return total


def _measure(
    highest: int,
    bins: Bins,
    others: Sequence[SpectralLine],
    frequency: np.ndarray,
    periodogram: np.ndarray,
    rate: float,
) -> SpectralLine | None:
    """The line at a bin, fitted in turn with its background; None where it is no line."""
    guess, bin_width = float(bins.centre[highest]), bins.width(highest)
    low, high = np.searchsorted(frequency, bins.around(highest))
    near, samples = frequency[low:high], periodogram[low:high]
    known = _total(others, bins.centre, rate)
    total = known
    line = None
    for _ in range(_ROUNDS):
        below = np.exp(np.interp(near, bins.centre, np.log(bins.background(total) + known)))
        (f0, width, peak), gain = _fit_line(guess, bin_width, near, samples, below)
        significant = _INDEPENDENT * gain > 1.5 * math.log(periodogram.size)
        inside = abs(f0 - guess) < 3.0 * bin_width
        if not (significant and inside and width < _WIDEST * bins.half * bin_width):
            return None
        line = SpectralLine(f0, width, math.sqrt(2.0 * math.pi * width * peak / rate))
        total = known + line.spectrum(bins.centre, rate)
    return line


def _fit_line(
    guess: float,
    bin_width: float,
    frequency: np.ndarray,
    periodogram: np.ndarray,
    background: np.ndarray,
) -> tuple[tuple[float, float, float], float]:
    """f0, width and peak by Fisher's scoring of Whittle's likelihood, and its gain over none."""
    sample = frequency[1] - frequency[0]
    close = np.abs(frequency - guess) < bin_width
    x = np.array([guess, math.log(bin_width), math.log(periodogram[close].mean())])

    def cost(x: np.ndarray) -> float:
        model = background + math.exp(x[2]) / (1.0 + ((frequency - x[0]) / math.exp(x[1])) ** 2)
        return float(np.sum(np.log(model) + periodogram / model))

    none = float(np.sum(np.log(background) + periodogram / background))
    lowest = cost(x)
    for _ in range(_STEPS):
        width = math.exp(x[1])
        offset = (frequency - x[0]) / width
        shape = 1.0 / (1.0 + offset**2)
        curve = math.exp(x[2]) * shape
        model = background + curve
        slopes = np.array(
            [2.0 * offset * shape / width, 2.0 * offset**2 * shape, np.ones(shape.size)]
        )
        slopes *= curve / model
        gradient = slopes @ (1.0 - periodogram / model)
        step = np.linalg.solve(slopes @ slopes.T + 1e-9 * np.eye(3), gradient)
        step = np.clip(step, [-bin_width, -1.0, -1.0], [bin_width, 1.0, 1.0])
        for _ in range(8):
            tried = x - step
            tried[1] = max(tried[1], math.log(sample))
            now = cost(tried)
            if now < lowest:
                break
            step = step / 2.0
        else:
            break
        done = lowest - now < 1e-3
        x, lowest = tried, now
        if done:
            break
    return (float(x[0]), math.exp(x[1]), math.exp(x[2])), none - lowest
