"""Is the residual normal? D'Agostino and Pearson's test.

    K² = Z(skewness)² / F₃ + Z(kurtosis)² / F₄  ~  χ²(2),   F_m = 1 + 2 Σ_k ρ_k^m

Z are the transforms to a standard normal of D'Agostino (1970) and Anscombe and Glynn (1983), right
from some fifty samples on, where the statistic of Jarque and Bera needs thousands. F widens
them where the residual is correlated (Lobato and Velasco 2004); they are one where it is white.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pivident.signals.noise_models import LaggedSums
from pivident.validation.residuals.autocorrelation import variance_factor
from pivident.validation.residuals.whitened_residual import SIGNIFICANCE, probability, reading

#: Skewness and excess kurtosis below which a distribution is as good as normal.
PRACTICAL_SKEWNESS = 0.5
PRACTICAL_KURTOSIS = 1.0


@dataclass(frozen=True)
class NormalityTest:
    """Test for a normal distribution."""

    statistic: float  # K²
    degrees_of_freedom: int  # 2
    p_value: float  # probability of a larger K² if the residual is normal
    skewness: float  # third standardised moment, 0 for a normal residual
    excess_kurtosis: float  # fourth standardised moment minus 3, 0 for a normal residual
    samples: int  # n

    @property
    def significant(self) -> bool:
        """Whether the probability is below ``SIGNIFICANCE``."""
        return self.p_value < SIGNIFICANCE

    @property
    def matters(self) -> bool:
        """Significant, and of practical size: skewness of 0.5 or excess kurtosis of 1."""
        large = (
            abs(self.skewness) >= PRACTICAL_SKEWNESS
            or abs(self.excess_kurtosis) >= PRACTICAL_KURTOSIS
        )
        return self.significant and large

    def __str__(self) -> str:
        return (
            f"Normality (D'Agostino-Pearson): K² = {self.statistic:.3g} on "
            f"{self.degrees_of_freedom} degrees of freedom, {probability(self.p_value)}; skewness "
            f"{self.skewness:.2g}, excess kurtosis {self.excess_kurtosis:.2g}: "
            f"{reading(self.significant, self.matters)}."
        )


def normality(values: np.ndarray, sums: LaggedSums | None = None) -> NormalityTest:
    """D'Agostino and Pearson's test.

    ``values``: residual without gaps, shape (samples,); ``sums``: its lagged sums; None: it is
    taken to be white.
    """
    from scipy.stats import chi2, kurtosis, kurtosistest, skew, skewtest

    thirds, fourths = (1.0, 1.0) if sums is None else (variance_factor(sums, m) for m in (3, 4))
    statistic = skewtest(values).statistic ** 2 / thirds + kurtosistest(values).statistic ** 2 / (
        fourths
    )
    return NormalityTest(
        float(statistic),
        2,
        float(chi2.sf(statistic, 2)),
        float(skew(values)),
        float(kurtosis(values)),
        values.size,
    )
