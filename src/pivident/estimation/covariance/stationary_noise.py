"""Covariance of an estimate whose residual is stationary noise of any colour.

With γ_j the autocovariance of joint j's residual, filtered as the equations are,

    P = G⁻¹ V G⁻ᵀ,   G = Σ_j Z_jᵀ Φ_j,   V = Σ_j Σ_t Σ_s z_j(t) γ_j(t - s) z_j(s)ᵀ

Instruments are free of noise, so γ is all that has to be estimated, from the whole record; the
standard errors are then twice as certain as those of the sandwich over windows, which has to find
the variance at each place of the record from that place alone.

γ is estimated over pairs of samples that are both used. Gaps, at standstill, would
otherwise spread the noise of high frequencies over the low ones, where the residual of a closed
loop has next to none and where the motion is. Up to ``MAX_LAG`` it is tapered by a Parzen
window, which has no negative spectrum. At the frequencies of the motion the estimate has taken
a share h(ω) from the noise (the leverage of these frequencies), and the spectrum is divided by
1 - h(ω).

The windows of the sandwich (`pivident.estimation.covariance.sandwich`) do not assume stationary
noise. If they find other variances, the residual comes in bursts or goes with the motion, as model
error does. Their ratio for parameter i is tested,

    R_i = P_windows,ii / P_stationary,ii  >  F₀.₉₅(ν_i, 4 ν_i)

4 ν_i because standard errors from the autocovariance are twice as certain. The parameters share
their noise, so that several may fail by chance together; more than ``MAX_FAILED`` of them do not,
and the windows count. Where windows are so few that a standard error √``MAX_UNSEEN`` too small
would pass, nothing is decided, and the wider variance of each parameter counts.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pivident.dynamics.regressor import Regressor
from pivident.estimation.covariance.sandwich import Jackknife
from pivident.estimation.equation_record import EquationRecord
from pivident.estimation.normal_equations import JointSums
from pivident.motion.kinematics import MOTION_BAND
from pivident.motion.motion import packed_stretch
from pivident.signals.noise_models import lagged_products
from pivident.signals.prefilter import Prefilter
from pivident.threads import run_in_threads

#: Longest lag of the autocovariance [s]: ten periods of the highest frequency of the motion. With
#: half of it the scenario *loop* gets standard errors 8 % too large, with four times the same.
MAX_LAG = 10.0 / MOTION_BAND

#: Fewest lags of it, for slow logs.
MIN_LAGS = 50

#: Largest share of a record that a lag may be: on short records few independent pairs are left.
MAX_SHARE = 1.0 / 14.0

#: Share of pairs of samples that must be in use for a lag to be estimated.
MIN_PAIRS = 0.05

#: Largest leverage that a spectrum is corrected for.
MAX_LEVERAGE = 0.7

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
) -> np.ndarray:
    """Covariance of the estimate, shape (parameters, parameters).

    ``residuals``: filtered residuals of each recording over √λ, shape (joints, samples).
    """
    size = len(regressor.parameters)
    gradient = np.zeros((size, size))
    for joint, lam in zip(sums, variance, strict=True):
        gradient[np.ix_(joint.columns, joint.columns)] += joint.zf / lam
    scale = np.sqrt(np.maximum(np.abs(np.diag(gradient)), 1e-300))
    inverse = np.linalg.inv(gradient / np.outer(scale, scale)) / np.outer(scale, scale)
    scores = score_variance(regressor, records, filters, sums, variance, residuals, inverse)
    return inverse @ scores @ inverse.T


def covariance_by_test(stationary: np.ndarray, windows: Jackknife) -> np.ndarray:
    """The covariance to report, shape (parameters, parameters).

    Undecided, it is D P_windows D with D_ii² = max(1, P_stationary,ii / P_windows,ii).
    """
    from scipy.stats import f

    nu = np.maximum(windows.degrees_of_freedom, 1.0)
    bound = f.ppf(1.0 - LEVEL, nu, 4.0 * nu)
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
                spectra[j].add(z, residual[j, span] * used, used)

            run_in_threads(add, range(len(sums)))
    scores = np.zeros_like(metric)
    for joint, own in zip(sums, spectra, strict=True):
        scores[np.ix_(joint.columns, joint.columns)] += own.variance_of_scores()
    return scores


def _spectra(
    records: Sequence[EquationRecord], sums: Sequence[JointSums], metric: np.ndarray
) -> list[JointSpectra]:
    """Empty sums of every joint."""
    rate = records[0].kinematics.recording.rate
    longest = min(max(r.used.shape[1] for r in records), MAX_STRETCH)
    lags = min(MAX_LAG * rate, MAX_SHARE * longest)
    lags = int(min(max(lags, MIN_LAGS), longest - 1))
    metrics = [metric[np.ix_(s.columns, s.columns)] for s in sums]
    return [JointSpectra(0.5 * (own + own.T), longest, lags) for own in metrics]


class JointSpectra:
    """What V of one joint needs, summed over stretches of the records.

    ``metric``: the joint's part of G⁻¹, shape (k, k).
    """

    def __init__(self, metric: np.ndarray, longest: int, lags: int) -> None:
        from scipy.fft import next_fast_len

        self.metric, self.lags = metric, lags
        # the noise spectrum, tapered, hardly changes within half a step of 1/lags
        self.width = max(1, longest // (2 * lags))
        self.length = next_fast_len(longest + lags, real=True)
        self.bins = -(-(self.length // 2 + 1) // self.width)
        self.cross = np.zeros((self.bins, *metric.shape))
        self.pairs, self.products, self.taken = np.zeros((3, lags + 1))

    def add(self, z: np.ndarray, residual: np.ndarray, used: np.ndarray) -> None:
        """Add a stretch; all that is not used is zero.

        ``z``: filtered instruments, shape (k, samples).
        """
        from scipy.fft import irfft, rfft

        spectrum = rfft(z, self.length)
        leverage = np.einsum(
            "ik,ik->k", spectrum.conj(), self.metric @ spectrum, optimize=True
        ).real
        self.pairs += lagged_products(used, self.lags, self.length)
        self.products += lagged_products(residual, self.lags, self.length)
        self.taken += irfft(leverage, self.length)[: self.lags + 1]
        spectrum[:, 1 : (self.length + 1) // 2] *= np.sqrt(2.0)  # negative frequencies
        binned = np.zeros((len(z), self.bins * self.width), dtype=complex)
        binned[:, : spectrum.shape[1]] = spectrum
        binned = binned.reshape(len(z), self.bins, self.width).transpose(1, 0, 2)
        self.cross += (binned @ binned.conj().transpose(0, 2, 1)).real

    def variance_of_scores(self) -> np.ndarray:
        """V, shape (k, k)."""
        known = np.maximum(self.pairs, MIN_PAIRS * self.pairs[0])
        noise = np.maximum(_spectrum(self.products / known, self.length), 0.0)
        leverage = _spectrum(self.taken / known, self.length)
        noise /= 1.0 - np.clip(leverage, 0.0, MAX_LEVERAGE)
        centres = np.minimum(np.arange(self.bins) * self.width + self.width // 2, noise.size - 1)
        return np.einsum("b,bij->ij", noise[centres], self.cross) / self.length


def _spectrum(autocovariance: np.ndarray, length: int) -> np.ndarray:
    """Spectrum of an autocovariance from lag zero on, tapered by a Parzen window."""
    from scipy.fft import rfft

    lag = np.arange(autocovariance.size) / (autocovariance.size - 1)
    taper = np.where(lag < 0.5, 1.0 - 6.0 * lag**2 * (1.0 - lag), 2.0 * (1.0 - lag) ** 3)
    even = np.zeros(length)
    even[: autocovariance.size] = taper * autocovariance
    even[-autocovariance.size + 1 :] += even[autocovariance.size - 1 : 0 : -1]
    return rfft(even).real
