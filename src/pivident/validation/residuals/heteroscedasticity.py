"""Does the residual's variance change with speed, acceleration or torque?

The squared residual is regressed on a constant and the drivers s (Breusch and Pagan 1979, in
Koenker's form, which does not take the residual to be normal), or on s, their squares and their
products as well (White 1980):

    n R² / F₂  ~  χ²(columns without the constant),   F₂ = 1 + 2 Σ_k ρ_k²

F₂ allows for a correlated residual whose squares say the same thing several times; it is one
where the residual is white.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pivident.signals.noise_models import LaggedSums
from pivident.validation.residuals.autocorrelation import variance_factor
from pivident.validation.residuals.whitened_residual import SIGNIFICANCE, probability, reading

#: Ratio of variances, between the quarters of the samples where a driver is largest and smallest,
#: below which it does not matter: standard errors then differ by a third.
PRACTICAL_RATIO = 1.8


@dataclass(frozen=True)
class VarianceTest:
    """Test for a variance that changes with the motion."""

    statistic: float  # n R² / F₂
    degrees_of_freedom: int  # number of independent drivers
    p_value: float  # probability of a larger one if the variance is constant
    explained: float  # R², share of the variance of the squared residual, 0 to 1
    #: Mean square where each driver is in its upper quarter over that in its lower one, by name of
    #: the driver.
    ratios: dict[str, float]
    samples: int  # n

    @property
    def driver(self) -> str:
        """The driver with the most extreme ratio."""
        return max(self.ratios, key=lambda name: abs(np.log(max(self.ratios[name], 1e-300))))

    @property
    def ratio(self) -> float:
        """Its ratio of variances."""
        return self.ratios[self.driver]

    @property
    def significant(self) -> bool:
        """Whether the probability is below ``SIGNIFICANCE``."""
        return self.p_value < SIGNIFICANCE

    @property
    def matters(self) -> bool:
        """Significant, and of practical size: variances differ by ``PRACTICAL_RATIO``."""
        return self.significant and max(self.ratio, 1.0 / self.ratio) >= PRACTICAL_RATIO

    def __str__(self) -> str:
        return (
            f"Constant variance (Breusch-Pagan): {self.statistic:.3g} on "
            f"{self.degrees_of_freedom} degrees of freedom, {probability(self.p_value)}; where "
            f"the {self.driver} is in its upper quarter the variance is {self.ratio:.2g} times "
            f"that in the lower one: {reading(self.significant, self.matters)}."
        )


def variance_test(
    values: np.ndarray,
    drivers: np.ndarray,
    names: Sequence[str],
    sums: LaggedSums | None = None,
    products: bool = False,
) -> VarianceTest:
    """Breusch and Pagan's or White's test.

    ``values``: residual without gaps, shape (samples,); ``drivers``: what the variance may depend
    on, shape (samples, drivers); ``sums``: the residual's lagged sums; None: it is taken to be
    white.
    """
    from scipy.stats import chi2

    squares = values**2
    columns = drivers - drivers.mean(axis=0)
    columns = columns / np.maximum(columns.std(axis=0), 1e-300)
    if products:
        first, second = np.triu_indices(columns.shape[1])
        columns = np.hstack([columns, columns[:, first] * columns[:, second]])
        columns -= columns.mean(axis=0)
    centred = squares - squares.mean()
    eigenvalues, vectors = np.linalg.eigh(columns.T @ columns)
    kept = eigenvalues > 1e-10 * eigenvalues[-1]
    fitted = (vectors.T @ (columns.T @ centred))[kept] ** 2 / eigenvalues[kept]
    explained = float(fitted.sum() / (centred @ centred))
    statistic = values.size * explained / (1.0 if sums is None else variance_factor(sums, 2))
    freedom = int(np.count_nonzero(kept))
    return VarianceTest(
        statistic,
        freedom,
        float(chi2.sf(statistic, freedom)),
        explained,
        {name: _quarters(squares, drivers[:, k]) for k, name in enumerate(names)},
        values.size,
    )


def _quarters(squares: np.ndarray, driver: np.ndarray) -> float:
    """Mean square in the upper quarter of the driver over that in the lower one."""
    low, high = np.quantile(driver, [0.25, 0.75])
    return float(squares[driver >= high].mean() / max(squares[driver <= low].mean(), 1e-300))
