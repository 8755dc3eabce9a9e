"""Spectra of a loop driven by its reference, separated from noise: the local polynomial method.

Around each bin the spectrum of a signal is

    X(k+i) = (g₀ + g₁ i + g₂ i²) R(k+i) + (h₀ + h₁ i) D(k+i) + (t₀ + t₁ i + t₂ i²) + V(k+i)

for |i| ≤ n, R the spectrum of the reference, D those of known disturbances (signs of friction,
which are neither a linear response to the reference nor noise), t the leakage from start and end of
the record, V noise. Least squares gives g, h, t and the spectral matrix of V for several
signals together (Pintelon and Schoukens, System Identification, 2012, ch. 7).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

#: Bins on each side, and degree of the polynomials.
HALF_WIDTH, DEGREE = 10, 2

#: Smallest power over noise of an excited bin.
EXCITED = 10.0

#: Smallest share of the reference's power that changes from bin to bin. A smooth motion leaks into
#: high frequencies as smoothly as transients do, and cannot be distinguished from them there.
ROUGH = 0.2


@dataclass(frozen=True, eq=False)
class LocalSpectra:
    """Spectra of several signals without the leakage from the ends."""

    frequency: np.ndarray  # shape (bins,) [Hz]
    x: np.ndarray  # spectra without transients, shape (bins, signals)
    disturbance: np.ndarray  # spectra of the disturbances, shape (bins, disturbances)
    driven: np.ndarray  # their part that follows from the reference, shape (bins, signals)
    noise: np.ndarray  # spectral matrices of the rest, shape (bins, signals, signals)
    excited: np.ndarray  # bins in which every signal exceeds its noise, shape (bins,)

    @property
    def excited_up_to(self) -> float:
        """Highest excited frequency around which most bins are excited; 0: none [Hz]."""
        width = 2 * HALF_WIDTH + 1
        if len(self.excited) < width:
            return 0.0
        share = np.convolve(self.excited, np.ones(width) / width, mode="same")
        found = np.flatnonzero(self.excited & (share > 0.5))
        return float(self.frequency[found[-1]]) if found.size else 0.0


def local_spectra(
    signals: np.ndarray,
    reference: np.ndarray,
    disturbance: np.ndarray,
    rate: float,
    low: float,
    high: float,
) -> LocalSpectra:
    """Local polynomial method for all signals (samples, signals) at once.

    ``reference`` (samples,) drives the loop, ``disturbance`` (samples, disturbances) acts in it.
    """
    samples, n = len(reference), HALF_WIDTH
    every = np.column_stack([signals, reference, disturbance])
    spectra = np.fft.rfft(every - every.mean(axis=0), axis=0) / np.sqrt(samples)
    frequency = np.fft.rfftfreq(samples, 1 / rate)
    bins = np.flatnonzero((frequency >= low) & (frequency <= high))
    bins = bins[(bins > n) & (bins < len(frequency) - n)]
    around = np.arange(-n, n + 1)
    powers = (around[:, None] / n) ** np.arange(DEGREE + 1)
    local = spectra[bins[:, None] + around]
    size = np.sqrt(np.mean(np.abs(local) ** 2, axis=1))
    size = np.where(size > 0, size, 1.0)
    local = local / size[:, None, :]
    m = signals.shape[1]
    driver, answers = local[:, :, m, None], local[:, :, :m]
    known = [local[:, :, i, None] * powers[:, :2] for i in range(m + 1, local.shape[2])]
    leaked = np.broadcast_to(powers, (len(bins), *powers.shape))
    k = np.concatenate([driver * powers, leaked, *known], axis=2)
    theta = np.linalg.pinv(k, rcond=1e-8) @ answers
    left = answers - k @ theta
    noise = np.einsum("kis,kit->kst", left, left.conj()) / (2 * n + 1 - k.shape[2])
    own = size[:, :m]
    transient = theta[:, DEGREE + 1, :] * own
    driven = theta[:, 0, :] * driver[:, n] * own
    smooth = powers @ np.linalg.pinv(powers)
    rough = np.mean(np.abs(driver[:, :, 0] @ (np.eye(2 * n + 1) - smooth)) ** 2, axis=1)
    power = np.abs(theta[:, 0, :]) ** 2 * rough[:, None]
    excited = np.all(power > EXCITED * np.einsum("kss->ks", noise).real, axis=1) & (rough > ROUGH)
    return LocalSpectra(
        frequency[bins],
        spectra[bins, :m] - transient,
        spectra[bins, m + 1 :],
        driven,
        noise * own[:, :, None] * own[:, None, :],
        excited,
    )
