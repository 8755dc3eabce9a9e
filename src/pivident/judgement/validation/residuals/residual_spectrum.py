"""Spectra of a joint's residual before and after whitening, and what white noise would look like.

Welch's estimate: stretches of L samples behind Hann's window, half overlapping, their periodograms
averaged,

    S(f) = 2/(rate Σw²) · mean |FFT(w x)|²                                     [unit²/Hz, one-sided]

and then averaged over bins of a twelfth of an octave. Of Gaussian noise S/E[S] is about χ²_ν/ν; K
half-overlapping stretches and n neighbouring frequencies of Hann's window are worth

    ν = 2 K²/(K + (K - 1)/18) · n²/(n + 2 (n - 1) (2/3)² + 2 (n - 2) (1/6)²)

degrees of freedom (Percival and Walden 1993), from which the band follows. Excluded
samples are gaps: stretches lie between them, and are shorter where gaps are close. Where gaps are
so close that hardly anything lies between them, as after decimation, they are filled with zeros and
Σw² counts the other samples: right for white noise, and blurred for other.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pivident.estimation.identification import Identification
from pivident.foundation.distributions import chi_square
from pivident.signals.noise_models import unmasked_stretches
from pivident.signals.prefilter import Prefilter

#: Longest and shortest stretch [samples].
LONGEST, SHORTEST = 16384, 32

#: A stretch length is used where it leaves so many stretches …
_FEWEST = 8

#: … that hold this share of the samples.
_SHARE = 0.6

#: Share of a stretch that must be in use where gaps are filled.
_PRESENT = 0.5

#: Bins per octave.
_PER_OCTAVE = 12

#: Probability that a white residual lies within its band, at each bin.
PROBABILITY = 0.95


@dataclass(frozen=True, eq=False)
class Spectrum:
    """One-sided power spectral density in bins."""

    frequency: np.ndarray  # centres of the bins [Hz], shape (bins,)
    density: np.ndarray  # [unit²/Hz], shape (bins,)
    freedom: np.ndarray  # degrees of freedom ν of each bin, shape (bins,)
    stretches: int  # number of stretches averaged
    length: int  # their length [samples]
    filled: bool = False  # whether there were gaps in them, filled with zeros

    def band(self, level: float | np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Within what 95 % of the bins lie if the true density is ``level`` [unit²/Hz]."""
        tail = 0.5 * (1.0 - PROBABILITY)
        low, high = (chi_square.ppf(p, self.freedom) / self.freedom for p in (tail, 1.0 - tail))
        return level * low, level * high

    def outside(self, level: float | np.ndarray) -> float:
        """Share of the bins outside that band, 0 to 1."""
        low, high = self.band(level)
        return float(np.mean((self.density < low) | (self.density > high)))


@dataclass(frozen=True, eq=False)
class ResidualSpectra:
    """Spectra of one joint's residual."""

    name: str  # joint
    torque_unit: str  # N m or N
    torque: Spectrum  # of τ - Φθ, as measured [torque_unit²/Hz]
    #: What the noise model says it is, at the same bins, 2/(rate |L|²); None without a prefilter.
    model: np.ndarray | None
    #: Of the residual of the equation that was solved, scaled to unit variance [1/Hz].
    white: Spectrum
    rate: float  # rate of the rows [Hz]

    @property
    def white_level(self) -> float:
        """Density of white noise of unit variance, 2/rate [1/Hz]."""
        return 2.0 / self.rate


def residual_spectra(identification: Identification) -> tuple[ResidualSpectra | None, ...]:
    """Spectra of all joints before and after the prefilter.

    Result: one entry per joint, None where too few samples are in use; empty without signals.
    """
    if not identification.recordings:
        return ()
    filters = scaled_prefilters(identification)
    rate = float(identification.recordings[0].whitened_rate)
    found: list[ResidualSpectra | None] = []
    for j, fit in enumerate(identification.joints):
        torque, white = [], []
        for r in identification.recordings:
            used = np.isfinite(r.whitened[:, j])
            torque.append(np.where(used, r.tau[:, j] - r.tau_model[:, j], np.nan))
            white.append(r.whitened[:, j])
        before, after = welch_spectrum(torque, rate), welch_spectrum(white, rate)
        if before is None or after is None:
            found.append(None)
            continue
        model = None
        if filters is not None:
            model = 2.0 / (rate * np.abs(filters[j].response(before.frequency, rate)) ** 2)
        found.append(ResidualSpectra(fit.name, fit.torque_unit, before, model, after, rate))
    return tuple(found)


def scaled_prefilters(identification: Identification) -> tuple[Prefilter, ...] | None:
    """L_j = λ_j^(-1/2) A_j N_j/D_j of every joint; None where nothing was prefiltered."""
    equations = identification.equations
    if equations is None or not equations.filters:
        return None
    if all(len(f.fir) == 1 and len(f.denominator) == 1 for f in equations.filters):
        return None
    return tuple(
        Prefilter(f.numerator, f.denominator, f.fir, float(variance))
        for f, variance in zip(equations.filters, equations.variance, strict=True)
    )


def welch_spectrum(pieces: Sequence[np.ndarray], rate: float) -> Spectrum | None:
    """Welch's estimate over the stretches between gaps, in bins.

    Result: the spectrum, None where not even short stretches are long enough.
    """
    parts = [
        piece[start:stop]
        for piece in pieces
        for start, stop in unmasked_stretches(~np.isfinite(piece))
    ]
    length = _stretch_length(np.array([part.size for part in parts], dtype=int))
    filled = length is None
    if filled:
        parts = list(pieces)
        length = _stretch_length(np.array([part.size for part in parts], dtype=int))
    if length is None or not any(np.isfinite(part).any() for part in parts):
        return None
    mean = np.nanmean(np.concatenate(parts))
    window = 0.5 - 0.5 * np.cos(2.0 * np.pi * (np.arange(length) + 0.5) / length)
    total, weight, count = np.zeros(length // 2 + 1), 0.0, 0
    for part in parts:
        for start in range(0, len(part) - length + 1, length // 2):
            stretch = part[start : start + length] - mean
            present = np.isfinite(stretch)
            if present.mean() < _PRESENT:
                continue
            transformed = np.fft.rfft(window * np.where(present, stretch, 0.0))
            total += transformed.real**2 + transformed.imag**2
            weight += float(np.dot(window**2, present))
            count += 1
    if count < _FEWEST:
        return None
    density = 2.0 / (rate * weight) * total
    frequency = np.arange(density.size) * rate / length
    # zero frequency has lost the mean, and it and the Nyquist frequency have half the freedom
    return replace(_in_bins(frequency[2:-1], density[2:-1], count, length), filled=filled)


def _stretch_length(lengths: np.ndarray) -> int | None:
    """The longest power of two of which there are enough, and which few samples are lost to."""
    samples = int(lengths.sum())
    length = LONGEST
    while length >= SHORTEST:
        long = lengths[lengths >= length]
        count = int(np.sum((long - length) // (length // 2) + 1))
        if count >= _FEWEST and long.sum() >= _SHARE * samples:
            return length
        length //= 2
    return None


def _in_bins(frequency: np.ndarray, density: np.ndarray, count: int, length: int) -> Spectrum:
    """Means over twelfths of octaves, at least one frequency each."""
    which = np.floor(_PER_OCTAVE * np.log2(frequency / frequency[0]) + 1e-9).astype(int)
    first = np.flatnonzero(np.r_[True, np.diff(which) > 0])
    n = np.diff(np.r_[first, frequency.size]).astype(float)
    stretches = 2.0 * count**2 / (count + (count - 1) / 18.0)
    neighbours = n**2 / (
        n + 2.0 * (n - 1.0) * (2.0 / 3.0) ** 2 + 2.0 * np.maximum(n - 2.0, 0.0) / 36.0
    )
    return Spectrum(
        np.add.reduceat(frequency, first) / n,
        np.add.reduceat(density, first) / n,
        stretches * neighbours,
        count,
        length,
    )
