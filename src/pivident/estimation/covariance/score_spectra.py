"""Variance of the scores Σ_a Σ_t z_a(t) w_a(t) of noise w that is stationary, of any colour.

    V = Σ_a Σ_b Σ_t Σ_s z_a(t) γ_ab(t - s) z_b(s)ᵀ = 1/N Re Σ_ω Σ_a Σ_b S_ab(ω) Z_a(ω) Z_b(ω)ᴴ

Series a are what one joint is judged by: one torque equation, or simulated positions and torques,
whose errors are correlated, since the law answers to the error of the position. γ is estimated over
pairs of samples that are both used, and tapered by a Parzen window, which has no negative spectrum.
At the frequencies of the motion the estimate has taken a share from the noise, the leverage

    L(ω)_ab = Z_aᴴ M Z_b,   M the covariance of the estimate for white noise

and the spectrum becomes (1 - L)^(-1/2) S (1 - L)^(-1/2).
"""

from __future__ import annotations

import numpy as np

#: Share of pairs of samples that must be in use for a lag to be estimated.
MIN_PAIRS = 0.05

#: Largest leverage that a spectrum is corrected for.
MAX_LEVERAGE = 0.7


class ScoreSpectra:
    """What V of one joint needs, summed over stretches of the records.

    Args:
        metric: M, the joint's part of it, shape (k, k).
        longest: samples of the longest stretch.
        lags: longest lag at which the noise is correlated.
        series: how many there are.
    """

    def __init__(self, metric: np.ndarray, longest: int, lags: int, series: int = 1) -> None:
        from scipy.fft import next_fast_len

        self.metric, self.lags = metric, lags
        # the noise spectrum, tapered, hardly changes within half a step of 1/lags
        self.width = max(1, longest // (2 * lags))
        self.length = next_fast_len(longest + lags, real=True)
        self.bins = -(-(self.length // 2 + 1) // self.width)
        kind = float if series == 1 else complex
        self.cross = np.zeros((self.bins, series, series, *metric.shape), kind)
        self.pairs, self.products, self.taken = np.zeros((3, series, series, self.length))

    def add(self, z: np.ndarray, noise: np.ndarray, used: np.ndarray) -> None:
        """Add a stretch; all that is not used is zero.

        ``z``: instruments or derivatives, shape (series, k, samples); ``noise``: residual of unit
        variance, shape (series, samples); ``used``: one or zero, likewise.
        """
        from scipy.fft import irfft, rfft

        self.pairs += self._products(used)
        self.products += self._products(noise)
        spectrum = rfft(z, self.length)
        weighted = self.metric @ spectrum
        for a, own in enumerate(spectrum.conj()):
            for b, other in enumerate(weighted):
                self.taken[a, b] += irfft(np.einsum("kf,kf->f", own, other), self.length)
        spectrum[..., 1 : (self.length + 1) // 2] *= np.sqrt(2.0)  # negative frequencies
        binned = np.zeros((*z.shape[:2], self.bins * self.width), dtype=complex)
        binned[..., : spectrum.shape[-1]] = spectrum
        binned = binned.reshape(*z.shape[:2], self.bins, self.width).transpose(2, 0, 1, 3)
        product = binned[:, :, None] @ binned[:, None].conj().swapaxes(-1, -2)
        self.cross += product.real if len(z) == 1 else product

    def _products(self, x: np.ndarray) -> np.ndarray:
        """Σ_t x_a(t) x_b(t + k), negative k from the end, shape (series, series, length)."""
        from scipy.fft import irfft, rfft

        spectrum = rfft(x, self.length)
        return irfft(spectrum.conj()[:, None] * spectrum, self.length)

    def variance_of_scores(self) -> np.ndarray:
        """V, shape (k, k)."""
        series = np.arange(len(self.pairs))
        full = self.pairs[series, series, 0]
        known = np.maximum(self.pairs, MIN_PAIRS * np.sqrt(np.outer(full, full))[:, :, None])
        centres = np.arange(self.bins) * self.width + self.width // 2
        centres = np.minimum(centres, self.length // 2)
        noise = self._spectrum(self.products / np.maximum(known, 1.0))[centres]
        leverage = self._spectrum(self.taken / np.maximum(known, 1.0))[centres]
        noise = _of_eigenvalues(noise, lambda level: np.maximum(level, 0.0))
        raised = _of_eigenvalues(leverage, lambda h: (1.0 - np.clip(h, 0.0, MAX_LEVERAGE)) ** -0.5)
        noise = raised @ noise @ raised
        return np.einsum("fab,fabij->ij", noise, self.cross, optimize=True).real / self.length

    def _spectrum(self, covariance: np.ndarray) -> np.ndarray:
        """Spectrum of γ_ab, tapered by a Parzen window, shape (frequencies, series, series)."""
        from scipy.fft import rfft

        steps = np.arange(self.length)
        lag = np.minimum(steps, self.length - steps) / self.lags
        taper = np.where(lag < 0.5, 1.0 - 6.0 * lag**2 * (1.0 - lag), 2.0 * (1.0 - lag) ** 3)
        spectrum = rfft(covariance * np.where(lag < 1.0, taper, 0.0)).transpose(2, 0, 1)
        return 0.5 * (spectrum + spectrum.conj().swapaxes(1, 2))


def _of_eigenvalues(matrices: np.ndarray, function) -> np.ndarray:
    """A function of Hermitian matrices, by their eigenvalues."""
    values, vectors = np.linalg.eigh(matrices)
    return (vectors * function(values)[:, None, :]) @ vectors.conj().swapaxes(1, 2)
