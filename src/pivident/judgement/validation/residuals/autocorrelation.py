"""Is the whitened residual white? Autocorrelations, Ljung and Box, Durbin and Watson.

    r_k = (Σ x_i x_{i+k} / n_k) / (Σ x_i² / n),   band ±2/√n_k              (Figure 5 of the paper)
    Q = (n + 2)/n Σ_{k≤K} n_k r_k²  ~  χ²(K - p),   K = p + 40                  (Ljung and Box 1978)
    Q̃ = Σ_{k≤K} (Σ x_i x_{i+k})² / Σ x_i² x_{i+k}²                (Dalla, Giraitis, Phillips 2022)

over the n_k pairs that there are; without gaps n_k = n - k and Q is the textbook's. p counts the
coefficients of the noise model. θ takes no degree of freedom: its regressors are no past residuals.
Q̃ has the same distribution where the variance changes along the record, as it does with speed;
Q then rejects white residuals too often.

An order p that a criterion has chosen says something about the lags beyond it: m coefficients more
would have gained less than their penalty c m (c = 2 for AIC, ln n for BIC), for every m. The gains
are the terms of Q, so that under the null Q has the distribution of

    Σ_{k≤K-p} z_k²   given that   Σ_{k≤m} z_k² ≤ c m   for all m,    z_k independent, normal

which is 1.6 smaller in the mean than χ²(40) for AIC, and rejects 5 % where χ² rejects 2 to 3 %.

What the test finds behind an AR model is often real. Torque that was averaged over two periods,
as the alignment with the positions does, is a moving average with a zero at the Nyquist frequency,
which no AR model of finite order whitens, and AIC stops where a further coefficient would cost
more than it explains. So the share of the variance that the past predicts stands beside p. High
orders on short records also distort the test: the ends of the record add about 1.5 p²/n to Q.

The residual that is tested: one joint's, over all recordings, with its gaps.

Rows that were not used are NaN. A correlation at lag k is made of the pairs of samples k apart of
which both are used and which lie in the same recording; their number n_k takes the place of n - k.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from pivident.estimation.identification import Identification
from pivident.estimation.method import Arma, AutoRegressive
from pivident.foundation.distributions import chi_square, normal
from pivident.signals.filters import convolution
from pivident.signals.noise_models import LaggedSums, lagged_sums

#: Lags tested beyond the order of the noise model.
EXTRA_LAGS = 40
#: Lags drawn, at least.
MIN_LAGS = 100
#: Lags of which the share beyond the band is counted, and that figures for papers show.
COUNTED_LAGS = 50
#: Correlation below which a single lag does not matter.
PRACTICAL_CORRELATION = 0.05
#: Share of the residual's variance, predicted from its past, below which it does not matter.
PRACTICAL_SHARE = 0.01
#: Step of the grid on which the distribution of Q is computed.
_STEP = 0.05
#: A correlation this many of its standard errors large is not there by chance, at any of many lags.
BEYOND_CHANCE = 4.5
#: Results with a smaller probability count as significant. There are as many tests as joints, so
#: one in twenty would be too often a false alarm.
SIGNIFICANCE = 0.01
#: Fewest samples that are tested, and fewest pairs that a lag needs.
MIN_SAMPLES = 50
MIN_PAIRS = 20


@dataclass(frozen=True, eq=False)
class Autocorrelation:
    """Autocorrelations of one residual, for the figure."""

    rho: np.ndarray  # r_k at lags 1, 2, …, NaN where there are too few pairs, shape (lags,)
    band: np.ndarray  # 2/√n_k; of white noise 95 % lie within, shape (lags,)
    rate: float  # samples per second, one lag is 1/rate [Hz]

    @property
    def outside(self) -> float:
        """Share of the autocorrelations outside the band, 0 to 1."""
        known = np.isfinite(self.rho)
        return float(np.mean(np.abs(self.rho[known]) > self.band[known])) if known.any() else 0.0


@dataclass(frozen=True, eq=False)
class JointResidual:
    """Whitened residual of one joint."""

    name: str  # joint
    #: Residual of each recording on consecutive rows, NaN where a row was not used.
    pieces: tuple[np.ndarray, ...]
    order: int = 0  # number of coefficients of the noise model that was fitted to it; 0 without one
    rate: float = 1.0  # rate of its rows [Hz]
    prefiltered: bool = False  # whether the equations were filtered before they were solved
    #: What each coefficient costs in the criterion that chose the order (AIC: 2, BIC: ln n); None:
    #: the order was given.
    penalty: float | None = None

    @property
    def values(self) -> np.ndarray:
        """The residual on the rows in use, one recording behind the other."""
        joined = np.concatenate(self.pieces) if self.pieces else np.empty(0)
        return joined[np.isfinite(joined)]


def joint_residuals(identification: Identification) -> tuple[JointResidual, ...]:
    """Whitened residuals of all joints."""
    if not identification.recordings:
        return tuple(JointResidual(fit.name, ()) for fit in identification.joints)
    return tuple(
        JointResidual(
            fit.name,
            tuple(r.whitened[:, j] for r in identification.recordings),
            fit.ar_order,
            float(identification.recordings[0].whitened_rate),
            fit.ar_order > 0 or fit.noise_unit != fit.torque_unit,
            None if fit.ar_at_bound else _penalty(identification, fit.rows),
        )
        for j, fit in enumerate(identification.joints)
    )


def _penalty(identification: Identification, rows: int) -> float | None:
    """Penalty per coefficient of the noise model's order; None where no order was searched."""
    method = identification.method_used
    return None if method is None else penalty_of(method.noise, rows)


def penalty_of(noise: AutoRegressive | Arma | None, rows: int) -> float | None:
    """The same of a recipe of noise models."""
    criterion = noise.criterion if isinstance(noise, AutoRegressive) else None
    if criterion in ("aic", "aicc"):
        return 2.0
    return round(math.log(max(rows, 8)), 1) if criterion == "bic" else None


def probability(p: float) -> str:
    """``p = 0.034`` or ``p < 0.001``."""
    return "p < 0.001" if p < 1e-3 else f"p = {p:.2g}"


def reading(significant: bool, matters: bool) -> str:
    """Significance and practical size, in words."""
    if not significant:
        return "not significant"
    return f"significant{' and of' if matters else ', but of no'} practical size"


class WithProbability:
    """A test by one probability, which is its `p_value`."""

    p_value: float

    @property
    def significant(self) -> bool:
        """Whether the probability is below ``SIGNIFICANCE``."""
        return self.p_value < SIGNIFICANCE


@dataclass(frozen=True)
class LjungBoxTest:
    """Test for whiteness."""

    statistic: float  # Q
    degrees_of_freedom: int  # lags tested minus coefficients of the noise model
    #: Probability of a larger Q if the residual is independent, of constant variance; by χ², or
    #: given that the order was chosen by a criterion.
    p_value: float
    robust_statistic: float  # Q̃
    #: Probability of a larger Q̃ if the residual is uncorrelated; its variance may change. The
    #: sentence goes by this one.
    robust_p_value: float
    largest: float  # largest |r_k|
    largest_lag: float  # its lag [s]
    largest_band: float  # 2/√n_k there
    #: S/(1 + S) with S = (Q - degrees of freedom)/n ≈ Σ ρ², share of the variance that the past
    #: predicts, exact for AR(1) (estimate, may be slightly negative).
    predictable: float
    samples: int  # n

    @property
    def significant(self) -> bool:
        """Whether the robust probability is below ``SIGNIFICANCE``."""
        return self.robust_p_value < SIGNIFICANCE

    @property
    def matters(self) -> bool:
        """Significant, and of practical size.

        The past predicts 1 % of the variance, or a lag is correlated beyond chance by 0.05.
        """
        peak = self.largest >= max(PRACTICAL_CORRELATION, 0.5 * BEYOND_CHANCE * self.largest_band)
        return self.significant and (self.predictable >= PRACTICAL_SHARE or peak)

    def __str__(self) -> str:
        share = 100.0 * max(self.predictable, 0.0)
        return (
            f"Autocorrelation (Ljung-Box): Q = {self.robust_statistic:.4g} on "
            f"{self.degrees_of_freedom} degrees of freedom, {probability(self.robust_p_value)}; "
            f"largest |ρ| {self.largest:.2g} at a lag of {1e3 * self.largest_lag:.3g} ms, the past "
            f"predicts {share:.2g} % of the variance: {reading(self.significant, self.matters)}."
        )


@dataclass(frozen=True)
class DurbinWatsonTest(WithProbability):
    """Durbin and Watson's d = Σ (x_i - x_{i+1})² / Σ x_i², about 2 (1 - ρ_1)."""

    statistic: float  # d, 2 for a white residual, below it for a positive correlation
    samples: int  # n
    #: two-sided probability of a d farther from 2 for a white residual, by the normal limit; NaN
    #: behind a noise model, which makes ρ_1 small whatever the noise is (Durbin 1970): there it is
    #: never significant.
    p_value: float

    @property
    def correlation(self) -> float:
        """Correlation of neighbours, 1 - d/2."""
        return 1.0 - 0.5 * self.statistic

    @property
    def matters(self) -> bool:
        """Significant, and of practical size: neighbours are correlated by 0.05."""
        return self.significant and abs(self.correlation) >= PRACTICAL_CORRELATION

    def __str__(self) -> str:
        text = (
            f"Neighbours (Durbin-Watson): d = {self.statistic:.3f} (2 is white), correlation "
            f"{self.correlation:.2g}"
        )
        if math.isnan(self.p_value):
            return f"{text}; not a test after a noise model, see Ljung-Box."
        return f"{text}, {probability(self.p_value)}: {reading(self.significant, self.matters)}."


def autocorrelation(
    residual: JointResidual, lags: int | None = None, sums: LaggedSums | None = None
) -> Autocorrelation:
    """Autocorrelations of a residual with the band of white noise.

    ``lags``: number of lags; None: 100, or those of the Ljung-Box test if there are more.
    """
    if sums is None:
        lags = max(MIN_LAGS, residual.order + EXTRA_LAGS) if lags is None else lags
        sums = lagged_sums(residual.pieces, lags)
    band = 2.0 / np.sqrt(np.maximum(sums.pairs[1:], 1.0))
    return Autocorrelation(_correlations(sums)[1:], band, residual.rate)


def correlated_shares(identification: Identification) -> list[float]:
    """Share of each joint's autocorrelations beyond ±2/√n; of white noise 0.05."""
    residuals = joint_residuals(identification)
    return [autocorrelation(residual, COUNTED_LAGS).outside for residual in residuals]


def ljung_box(
    residual: JointResidual, extra: int = EXTRA_LAGS, sums: LaggedSums | None = None
) -> LjungBoxTest:
    """Ljung and Box's test at K = p + ``extra`` lags; lags of too few pairs are left out."""
    lags = residual.order + extra
    sums = lagged_sums(residual.pieces, lags) if sums is None else sums
    n = float(sums.pairs[0])
    pairs, products, squares = (x[1 : lags + 1] for x in (sums.pairs, sums.products, sums.squares))
    usable = pairs >= MIN_PAIRS
    rho = _correlations(sums)[1 : lags + 1]
    freedom = max(int(np.count_nonzero(usable)) - residual.order, 1)
    statistic = float((n + 2) / n * np.sum(pairs[usable] * rho[usable] ** 2))
    excess = (statistic - freedom) / n
    robust = float(np.sum(products[usable] ** 2 / np.maximum(squares[usable], 1e-300)))
    peak = int(np.nanargmax(np.where(usable, np.abs(rho), 0.0)))
    return LjungBoxTest(
        statistic,
        freedom,
        upper_tail(statistic, freedom, residual.penalty),
        robust,
        upper_tail(robust, freedom, residual.penalty),
        float(abs(rho[peak])),
        (peak + 1) / residual.rate,
        float(2.0 / math.sqrt(max(pairs[peak], 1.0))),
        excess / (1.0 + excess),
        int(n),
    )


def durbin_watson(residual: JointResidual) -> DurbinWatsonTest:
    """Durbin and Watson's statistic over neighbours that are both used; nothing is centred."""
    steps = np.concatenate([np.diff(piece) for piece in residual.pieces])
    steps = steps[np.isfinite(steps)]
    values = residual.values
    n = values.size
    d = float(np.mean(steps**2) / np.mean(values**2) * (n - 1) / n)
    score = (d - 2.0 * (n - 1) / n) / (2.0 / math.sqrt(steps.size))
    white = residual.order == 0 and not residual.prefiltered
    return DurbinWatsonTest(d, n, float(2.0 * normal.sf(abs(score))) if white else math.nan)


def upper_tail(statistic: float, freedom: int, penalty: float | None = None) -> float:
    """Probability of a larger Q under the null.

    ``penalty``: c of the criterion that chose the order; None: the order was given, χ².
    """
    if penalty is None:
        return float(chi_square.sf(statistic, freedom))
    grid, tail = _selected_tail(freedom, penalty)
    return float(np.interp(statistic, grid, tail, right=0.0))


@lru_cache(maxsize=64)
def _selected_tail(freedom: int, penalty: float) -> tuple[np.ndarray, np.ndarray]:
    """Σ z² given Σ_{k≤m} z_k² ≤ c m for all m: a grid, and the probability of more than it.

    The density is convolved with that of z² and cut at c m, one m after the other.
    """
    count = int(penalty * freedom / _STEP) + 1
    edges = (np.arange(count + 1) - 0.5) * _STEP
    one = np.diff(chi_square.cdf(np.maximum(edges, 0.0), 1))
    mass = np.zeros(count)
    mass[0] = 1.0
    for m in range(1, freedom + 1):
        mass = np.maximum(convolution(mass, one)[:count], 0.0)
        mass[int(penalty * m / _STEP) + 1 :] = 0.0
    tail = 1.0 - np.cumsum(mass) / mass.sum()
    return (np.arange(count) + 0.5) * _STEP, np.clip(tail, 0.0, 1.0)


def variance_factor(sums: LaggedSums, power: int) -> float:
    """1 + 2 Σ ρ_k^power over correlations that are there beyond chance; at least one.

    By so much a mean of Hermite polynomials of that order scatters more than of a white residual:
    squares by power 2, skewness by 3, kurtosis by 4 (Lobato and Velasco 2004).
    """
    rho = _correlations(sums)[1:]
    present = np.isfinite(rho) & (np.abs(rho) * np.sqrt(sums.pairs[1:]) > BEYOND_CHANCE)
    return max(1.0, 1.0 + 2.0 * float(np.sum(rho[present] ** power)))


def _correlations(sums: LaggedSums) -> np.ndarray:
    """r_k at lags 0 …, NaN where there are too few pairs."""
    enough = sums.pairs >= MIN_PAIRS
    means = sums.products / np.maximum(sums.pairs, 1.0)
    return np.where(enough, means / means[0], np.nan)
