"""Covariance of an estimate whose residual is stationary noise of any colour.

With γ_j the autocovariance of joint j's residual, filtered as the equations are,

    P = G⁻¹ V G⁻ᵀ,   G = Σ_j Z_jᵀ Φ_j,   V = Σ_j Σ_t Σ_s z_j(t) γ_j(t - s) z_j(s)ᵀ

Instruments are free of noise, so γ is all that has to be estimated, from the whole record; the
standard errors are then twice as certain as those of the sandwich over windows, which has to find
the variance at each place of the record from that place alone.

γ is estimated over pairs of samples that are both used, up to ``MAX_LAG`` (`ScoreSpectra`). Gaps,
at standstill, would otherwise spread the noise of high frequencies over the low ones, where the
residual of a closed loop has next to none and where the motion is.

The windows of the sandwich (`pivident.estimation.covariance.sandwich`) do not assume stationary
noise. If they find other variances, the residual comes in bursts or goes with the motion, as model
error does. Their ratio for parameter i is tested,

    R_i = P_windows,ii / P_stationary,ii  >  F₀.₉₅(ν_i, 4 ν_i)

4 ν_i because standard errors from the autocovariance are twice as certain. The parameters share
their noise, so that several may fail by chance together; more than ``MAX_FAILED`` of them do not,
and the windows count. Where windows are so few that a standard error √``MAX_UNSEEN`` too small
would pass, nothing is decided, and the wider variance of each parameter counts.

Variance of the scores Σ_a Σ_t z_a(t) w_a(t) (`ScoreSpectra`):

    V = Σ_a Σ_b Σ_t Σ_s z_a(t) γ_ab(t - s) z_b(s)ᵀ = 1/N Re Σ_ω Σ_a Σ_b S_ab(ω) Z_a(ω) Z_b(ω)ᴴ

Series a are what one joint is judged by: one torque equation, or simulated positions and torques,
whose errors are correlated, since the law answers to the error of the position. γ is estimated over
pairs of samples that are both used, and tapered by a Parzen window, which has no negative spectrum.
At the frequencies of the motion the estimate has taken a share from the noise, the leverage

    L(ω)_ab = Z_aᴴ M Z_b,   M the covariance of the estimate for white noise

and the spectrum becomes (1 - L)^(-1/2) S (1 - L)^(-1/2).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pivident.dynamics.regressor import Regressor
from pivident.estimation.covariance.sandwich import Jackknife
from pivident.estimation.equation_record import EquationRecord
from pivident.estimation.normal_equations import JointSums
from pivident.estimation.restrictions import Freedom
from pivident.foundation.distributions import fisher
from pivident.foundation.threads import run_in_threads
from pivident.loop.motion.motion import MOTION_BAND, packed_stretch
from pivident.signals.filters import fast_length
from pivident.signals.prefilter import Prefilter

#: Longest lag of the autocovariance [s]: ten periods of the highest frequency of the motion. With
#: half of it the scenario *loop* gets standard errors 8 % too large, with four times the same.
MAX_LAG = 10.0 / MOTION_BAND

#: Fewest lags of it, for slow logs.
MIN_LAGS = 50

#: Largest share of a record that a lag may be: on short records few independent pairs are left.
MAX_SHARE = 1.0 / 14.0

#: Longest stretch that is transformed at once. Longer records are taken apart; what is lost are
#: products across the joints, a few thousandths.
MAX_STRETCH = 2**17

#: Level of the test of one parameter.
LEVEL = 0.05

#: Share of the parameters that may fail it by chance. In records of the scenarios *fine* and *loop*
#: (200 each) and *coloured* (24) 0 to 21 % do, in *coarse* 39 to 50 %.
MAX_FAILED = 0.25

#: Largest ratio of variances that a test which decides may let pass.
MAX_UNSEEN = 2.5


def stationary_covariance(
    regressor: Regressor,
    records: Sequence[EquationRecord],
    filters: Sequence[Prefilter],
    sums: Sequence[JointSums],
    variance: np.ndarray,
    residuals: Sequence[np.ndarray],
    freedom: Freedom,
) -> np.ndarray:
    """Covariance of the estimate, shape (parameters, parameters).

    ``residuals``: filtered residuals of each recording over √λ, shape (joints, samples);
    ``freedom``: of the parameters.
    """
    size = len(regressor.parameters)
    gradient = np.zeros((size, size))
    for joint, lam in zip(sums, variance, strict=True):
        gradient[np.ix_(joint.columns, joint.columns)] += joint.zf / lam
    inverse = freedom.bread(gradient)
    scores = score_variance(regressor, records, filters, sums, variance, residuals, inverse)
    return inverse @ (scores + freedom.information) @ inverse.T


def covariance_by_test(stationary: np.ndarray, windows: Jackknife) -> np.ndarray:
    """The covariance to report, shape (parameters, parameters).

    Undecided, it is D P_windows D with D_ii² = max(1, P_stationary,ii / P_windows,ii).
    """
    nu = np.maximum(windows.degrees_of_freedom, 1.0)
    bound = fisher.ppf(1.0 - LEVEL, nu, 4.0 * nu)
    found = windows.covariance
    ratio = np.diag(found) / np.maximum(np.diag(stationary), 1e-300)
    if np.median(bound) > MAX_UNSEEN:
        wider = np.sqrt(np.maximum(1.0, 1.0 / np.maximum(ratio, 1e-300)))
        return found * np.outer(wider, wider)
    return stationary if np.mean(ratio > bound) <= MAX_FAILED else found


def score_variance(
    regressor: Regressor,
    records: Sequence[EquationRecord],
    filters: Sequence[Prefilter],
    sums: Sequence[JointSums],
    variance: np.ndarray,
    residuals: Sequence[np.ndarray],
    metric: np.ndarray,
) -> np.ndarray:
    """V, the variance of the scores Σ_j Zᵀε_j/λ_j, shape (parameters, parameters).

    ``residuals``: filtered residuals of each recording over √λ, shape (joints, samples);
    ``metric``: covariance of the estimate by its weights, shape (parameters, parameters): gives the
    share h(ω) of the noise that the estimate took.
    """
    spectra = _spectra(records, sums, metric)
    for record, residual in zip(records, residuals, strict=True):
        source = record.kinematics if record.motion is None else record.motion
        streams = [f.stream(s.columns.size, threads=1) for f, s in zip(filters, sums, strict=True)]
        for first in range(0, record.used.shape[1], MAX_STRETCH):
            span = slice(first, first + MAX_STRETCH)
            packed = packed_stretch(regressor, source, span)

            def add(
                j: int, record=record, residual=residual, streams=streams, span=span, packed=packed
            ) -> None:
                own = slice(regressor.offsets[j], regressor.offsets[j + 1])
                used = record.used[j, span].astype(float)
                z = streams[j].process(packed[own], seen=record.seen[j, span])
                z *= used / np.sqrt(variance[j])
                if record.row_weights is not None:  # the residual has the other half of them
                    z *= np.sqrt(record.row_weights[j, span])
                spectra[j].add(z[None], (residual[j, span] * used)[None], used[None])

            run_in_threads(add, range(len(sums)))
    scores = np.zeros_like(metric)
    for joint, own in zip(sums, spectra, strict=True):
        scores[np.ix_(joint.columns, joint.columns)] += own.variance_of_scores()
    return scores


def _spectra(
    records: Sequence[EquationRecord], sums: Sequence[JointSums], metric: np.ndarray
) -> list[ScoreSpectra]:
    """Empty sums of every joint."""
    longest = min(max(r.used.shape[1] for r in records), MAX_STRETCH)
    lags = longest_lag(records[0].kinematics.recording.rate, longest)
    metrics = [metric[np.ix_(s.columns, s.columns)] for s in sums]
    return [ScoreSpectra(0.5 * (own + own.T), longest, lags) for own in metrics]


def longest_lag(rate: float, longest: int, least: int = MIN_LAGS) -> int:
    """Lag up to which noise is correlated [samples]; ``longest``: samples of a stretch."""
    lags = min(MAX_LAG * rate, MAX_SHARE * longest)
    return int(min(max(lags, least), longest - 1))


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
        self.metric, self.lags = metric, lags
        # the noise spectrum, tapered, hardly changes within half a step of 1/lags
        self.width = max(1, longest // (2 * lags))
        self.length = fast_length(longest + lags)
        self.bins = -(-(self.length // 2 + 1) // self.width)
        kind = float if series == 1 else complex
        self.cross = np.zeros((self.bins, series, series, *metric.shape), kind)
        self.pairs, self.products, self.taken = np.zeros((3, series, series, self.length))

    def add(self, z: np.ndarray, noise: np.ndarray, used: np.ndarray) -> None:
        """Add a stretch; all that is not used is zero.

        ``z``: instruments or derivatives, shape (series, k, samples); ``noise``: residual of unit
        variance, shape (series, samples); ``used``: one or zero, likewise.
        """
        self.pairs += self._products(used)
        self.products += self._products(noise)
        spectrum = np.fft.rfft(z, self.length)
        weighted = self.metric @ spectrum
        for a, own in enumerate(spectrum.conj()):
            for b, other in enumerate(weighted):
                self.taken[a, b] += np.fft.irfft(np.einsum("kf,kf->f", own, other), self.length)
        spectrum[..., 1 : (self.length + 1) // 2] *= np.sqrt(2.0)  # negative frequencies
        binned = np.zeros((*z.shape[:2], self.bins * self.width), dtype=complex)
        binned[..., : spectrum.shape[-1]] = spectrum
        binned = binned.reshape(*z.shape[:2], self.bins, self.width).transpose(2, 0, 1, 3)
        product = binned[:, :, None] @ binned[:, None].conj().swapaxes(-1, -2)
        self.cross += product.real if len(z) == 1 else product

    def _products(self, x: np.ndarray) -> np.ndarray:
        """Σ_t x_a(t) x_b(t + k), negative k from the end, shape (series, series, length)."""
        spectrum = np.fft.rfft(x, self.length)
        return np.fft.irfft(spectrum.conj()[:, None] * spectrum, self.length)

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
        steps = np.arange(self.length)
        lag = np.minimum(steps, self.length - steps) / self.lags
        taper = np.where(lag < 0.5, 1.0 - 6.0 * lag**2 * (1.0 - lag), 2.0 * (1.0 - lag) ** 3)
        spectrum = np.fft.rfft(covariance * np.where(lag < 1.0, taper, 0.0)).transpose(2, 0, 1)
        return 0.5 * (spectrum + spectrum.conj().swapaxes(1, 2))


def _of_eigenvalues(matrices: np.ndarray, function) -> np.ndarray:
    """A function of Hermitian matrices, by their eigenvalues."""
    values, vectors = np.linalg.eigh(matrices)
    return (vectors * function(values)[:, None, :]) @ vectors.conj().swapaxes(1, 2)
