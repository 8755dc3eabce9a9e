"""Autoregressive noise models by Burg's method, and whether a residual is white.

A residual v is modelled as filtered white noise (the noise model of (P-29)),

    v_k = e_k / A(z⁻¹),     A = 1 + a_1 z⁻¹ + … + a_p z⁻ᵖ,     var e = λ

so that A whitens it. Burg's method gives reflection coefficients k_p order by order (``burg.py``),
and with them

    A_p = A_{p-1} + k_p z⁻ᵖ A_{p-1}(z),     λ_p = λ_{p-1} (1 - k_p²).

All orders come out of one pass, every one of them stable, without the window of the Yule-Walker
equations, which fail on spectra with a deep notch such as low-pass filtering leaves.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from pivident.foundation.errors import IdentificationError
from pivident.signals.burg import reflection_coefficients
from pivident.signals.filters import fast_length
from pivident.signals.prefilter import StreamingFilter


@dataclass(frozen=True, eq=False)
class LaggedSums:
    """Sums over the pairs of samples at lags 0 … K, each of shape (K + 1,)."""

    products: np.ndarray  # Σ x_i x_{i+k} of the centred signal x
    squares: np.ndarray  # Σ x_i² x_{i+k}²
    pairs: np.ndarray  # n_k, number of pairs


def lagged_products(x: np.ndarray, lags: int, length: int | None = None) -> np.ndarray:
    """Σ_i x_i x_{i+k} for k = 0 … K, shape (K + 1,)."""
    length = fast_length(x.size + lags) if length is None else length
    return np.fft.irfft(np.abs(np.fft.rfft(x, length)) ** 2, length)[: lags + 1]


def lagged_sums(pieces: Sequence[np.ndarray], lags: int) -> LaggedSums:
    """Sums over the pairs within each piece, common mean removed; NaN has no pair."""
    apart = np.full(lags, np.nan)  # no lag reaches from one piece into the next
    x = np.concatenate([part for piece in pieces for part in (apart, piece)][1:])
    present = np.isfinite(x)
    x = np.where(present, x - x[present].mean(), 0.0)
    if len(pieces) == 1 and present.all():
        pairs = x.size - np.arange(lags + 1.0)
    else:
        pairs = np.round(lagged_products(present.astype(float), lags))
    return LaggedSums(lagged_products(x, lags), lagged_products(x * x, lags), pairs)


Criterion = Literal["aic", "aicc", "bic"]

#: A stretch must have this many samples for every order searched.
_SAMPLES_PER_ORDER = 2

#: Minimum number of samples in the longest stretch.
_SHORTEST_STRETCH = 10


@dataclass(frozen=True, eq=False)
class ArModel:
    """An autoregressive model A(z⁻¹) v = e."""

    coefficients: np.ndarray  # A, monic, (order + 1,)
    innovation_variance: float  # λ, variance of e, in squared units of v
    criteria: np.ndarray  # value of the criterion at orders 0 … p_max
    criterion: Criterion
    order_max: int  # largest order searched
    given: bool  # whether the order was given, not searched
    mean: float  # of the samples, removed before the fit
    samples: int  # number of samples used

    @property
    def order(self) -> int:
        """Order p."""
        return len(self.coefficients) - 1

    @property
    def at_bound(self) -> bool:
        """Whether the search ended at its largest order.

        The spectrum then has a zero close to the unit circle: over-filtered data, or a
        prefilter with a zero at z = 1.
        """
        return not self.given and self.order == self.order_max

    def spectrum(self, frequency: np.ndarray, rate: float) -> np.ndarray:
        """One-sided power spectral density 2λ / (rate |A|²) at the frequencies [units²/Hz]."""
        z = np.exp(-2j * np.pi * np.asarray(frequency) / rate)
        return (
            2
            * self.innovation_variance
            / (rate * np.abs(np.polyval(self.coefficients[::-1], z)) ** 2)
        )


def fit_ar(
    v: np.ndarray,
    p_max: int = 150,
    criterion: Criterion = "aic",
    *,
    order: int | None = None,
    mask: np.ndarray | None = None,
    segments: np.ndarray | None = None,
    skip: int = 0,
    shortest: int | None = None,
) -> ArModel:
    """Burg's autoregressive model of a residual, order by an information criterion.

    AIC = N ln λ_p + 2 (p + 1); AICc adds 2 (p+1)(p+2) / (N - p - 2); BIC has ln N for 2, and gives
    about half the order of AIC. Orders are searched up to ``p_max`` (half the longest stretch on
    short records) unless ``order`` is given. The model is fitted over the stretches between masked
    samples (True: left out), or over ``segments``, rows of (start, stop), without a product across
    a gap; the first ``skip`` samples and stretches of fewer than ``shortest`` samples (None: twice
    the largest order) are ignored.
    """
    v = np.ascontiguousarray(v, dtype=float)
    if segments is None:
        left_out = np.zeros(v.size, dtype=bool) if mask is None else np.array(mask, dtype=bool)
        left_out[:skip] = True
        segments = unmasked_stretches(left_out)
    else:
        segments = np.array(segments, dtype=np.int64).reshape(-1, 2)
        segments[:, 0] = np.maximum(segments[:, 0], skip)
    lengths = segments[:, 1] - segments[:, 0]
    longest, carried = int(lengths.max(initial=0)), highest_order(segments)
    highest = min(p_max if order is None else order, carried)
    wanted = _SAMPLES_PER_ORDER * highest if shortest is None else shortest
    segments = segments[lengths >= max(wanted, 2)]
    if not carried or not len(segments) or (order or 0) > highest:
        raise IdentificationError(
            f"the longest stretch of residual has {longest} sample(s), too few for a noise model "
            f"of order {p_max if order is None else order}",
            advice="lower the order or mask fewer samples",
        )
    used = np.concatenate([v[start:stop] for start, stop in segments])
    mean = float(used.mean())
    variance = float(np.mean((used - mean) ** 2))
    if not math.isfinite(variance):
        raise IdentificationError(
            f"the residual has {np.count_nonzero(~np.isfinite(used))} sample(s) that are NaN or "
            "infinite",
            advice="there is no noise model of it",
        )
    if variance <= (np.finfo(float).eps * np.abs(used).max()) ** 2:
        raise IdentificationError(
            f"the residual is constant ({mean:.6g}) over {used.size} samples",
            advice="there is no noise to model. Check that the torque channel is not a computed "
            "one",
        )
    stops = np.cumsum(segments[:, 1] - segments[:, 0])
    reflections = reflection_coefficients(used - mean, stops, highest)
    variances = variance * np.cumprod(np.r_[1.0, 1 - reflections**2])
    criteria = _information(variances, used.size, criterion)
    chosen = int(np.argmin(criteria)) if order is None else order
    return ArModel(
        coefficients=_step_up(reflections[:chosen]),
        innovation_variance=float(variances[chosen]),
        criteria=criteria,
        criterion=criterion,
        order_max=highest,
        given=order is not None,
        mean=mean,
        samples=used.size,
    )


#: What a filter left of a power spectrum, by frequency [Hz].
Passed = Callable[[np.ndarray], np.ndarray]


def continued_into_band(
    model: ArModel, rate: float, band: float, passed: Passed = np.ones_like
) -> ArModel:
    """The model of the noise alone, where model error covers it inside the motion's band.

    A measured residual is noise plus the error of the robot's model, and the latter lies in the
    band of the motion. Its spectrum there must not count as noise: a whitener would suppress the
    very frequencies that hold the information. So the level just beyond the band [Hz] is continued
    to zero frequency,

        S(f) = min(S(f), S̄ P(f))   for f < band,   S̄ the mean of S/P over [band, 1.5 band]

    with P what a filter of the samples, ``passed``, has left of any power spectrum. The AR model of
    this spectrum, of the same order, is solved from its autocovariances (Levinson).
    """
    from scipy.linalg import solve_toeplitz

    if model.order == 0 or band <= 0:
        return model
    points = 16384
    frequency = np.linspace(0.0, 0.5 * rate, points + 1)
    gain = np.abs(np.fft.rfft(model.coefficients, 2 * points)) ** 2
    spectrum = 2 * model.innovation_variance / (rate * gain)
    edge = (frequency >= band) & (frequency <= 1.5 * band)
    if not edge.any():  # the band is narrower than this grid resolves
        return model
    inside = frequency < band
    level = (spectrum[edge] / passed(frequency[edge])).mean()
    spectrum[inside] = np.minimum(spectrum[inside], level * passed(frequency[inside]))
    covariance = np.fft.irfft(spectrum)[: model.order + 1]
    solved = solve_toeplitz(covariance[:-1], -covariance[1:])
    variance = 0.5 * rate * (covariance[0] + solved @ covariance[1:])
    return replace(model, coefficients=np.r_[1.0, solved], innovation_variance=float(variance))


def excess_in_band(
    model: ArModel, rate: float, band: float, passed: Passed = np.ones_like
) -> float:
    """Mean level below ``band`` [Hz] over that just beyond it: about one for noise alone."""
    if band <= 0:
        return 1.0
    inside, beyond = np.linspace(0.0, band, 64), np.linspace(band, 1.5 * band, 64)
    levels = [model.spectrum(f, rate) / passed(f) for f in (inside, beyond)]
    return float(levels[0].mean() / levels[1].mean())


def highest_order(segments: np.ndarray) -> int:
    """Largest order that the longest of some stretches carries, rows of (start, stop); 0: none."""
    longest = int((segments[:, 1] - segments[:, 0]).max(initial=0))
    return longest // _SAMPLES_PER_ORDER if longest >= _SHORTEST_STRETCH else 0


def whiten(model: ArModel, x: np.ndarray) -> np.ndarray:
    """A(z⁻¹) x along axis 0, from rest; the first ``order`` samples are a transient."""
    rows = np.atleast_2d(np.asarray(x, dtype=float).T)
    white = StreamingFilter((1.0,), (1.0,), model.coefficients, len(rows)).process(rows)
    return white[0] if np.ndim(x) == 1 else np.ascontiguousarray(white.T)


def unmasked_stretches(mask: np.ndarray) -> np.ndarray:
    """Rows (start, stop) of the stretches where the mask is False, shape (stretches, 2)."""
    edges = np.flatnonzero(np.diff(np.r_[True, np.asarray(mask, dtype=bool), True]))
    return edges.reshape(-1, 2)


def _information(variances: np.ndarray, samples: int, criterion: Criterion) -> np.ndarray:
    """The criterion at all orders."""
    count = np.arange(variances.size) + 1
    fit = samples * np.log(np.maximum(variances, np.finfo(float).tiny))
    if criterion == "bic":
        return fit + math.log(samples) * count
    if criterion == "aic":
        return fit + 2 * count
    if criterion == "aicc":
        return fit + 2 * count + 2 * count * (count + 1) / np.maximum(samples - count - 1, 1)
    raise IdentificationError(
        f"criterion {criterion!r} for a noise model", advice="expected aic, aicc or bic"
    )


def _step_up(reflections: np.ndarray) -> np.ndarray:
    """A from its reflection coefficients: a ← (a, 0) + k (0, reversed a)  (Levinson)."""
    a = np.zeros(reflections.size + 1)
    a[0] = 1.0
    for p, k in enumerate(reflections, start=2):
        a[:p] = a[:p] + k * a[:p][::-1]  # a[p - 1] is still zero
    return a
