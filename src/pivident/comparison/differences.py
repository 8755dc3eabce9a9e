"""The difference of two estimates with its interval, and which of many differences are significant.

With the lower and upper halves l and u of the two intervals (2σ each where they are symmetric),

    θ_b - θ_a   from  -c(l_b, u_a)  to  +c(u_b, l_a),     c(x, y) = √(x² + y²)   or   x + y

The first c is for independent errors (Zou and Donner 2008 for intervals that are not symmetric).
Estimates from the same record share its noise, and how much of it depends on both methods: their
correlation is not known. The second c holds for any correlation, by Cauchy's inequality:
√(σ_a² + σ_b² - 2 ρ σ_a σ_b) ≤ σ_a + σ_b.

Of 200 parameters that do not differ, ten differ "significantly" at 5 %. Holm (1979) orders the
probabilities p_(1) ≤ … ≤ p_(m) and takes

    p̃_(k) = max_{i ≤ k} min(1, (m - i + 1) p_(i))

The probability of one false finding or more among all p̃ ≤ α is then at most α, however the tests
depend on each other.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pivident.comparison.entry import Entry


@dataclass(frozen=True)
class Estimate:
    """One parameter of one result."""

    value: float
    low: float  # lower end of its interval (2σ), NaN without one
    high: float  # upper end, likewise
    #: parameters of that result that it is a sum of, where it is not one of them
    from_groups: tuple[str, ...] = ()

    @property
    def spread(self) -> float:
        """Half the length of the interval, 2σ; NaN without one."""
        return 0.5 * (self.high - self.low)


@dataclass(frozen=True)
class Difference:
    """An estimate less the first one.

    Attributes:
        value: θ_b - θ_a.
        low: lower end of its interval (2σ), NaN without one.
        high: upper end, likewise.
        z: difference over its standard error on the side of zero, NaN without an interval.
        p_value: two-sided probability of a larger |z| where there is no difference.
        p_adjusted: after Holm, among all differences of the comparison.
        relative: 100 (θ_b - θ_a)/|θ_a| [%], infinite where only θ_a is zero.
    """

    value: float
    low: float
    high: float
    z: float
    p_value: float
    p_adjusted: float
    relative: float

    @property
    def spread(self) -> float:
        """Half the length of the interval, 2σ; NaN without one."""
        return 0.5 * (self.high - self.low)


def share_a_record(a: Entry, b: Entry) -> bool:
    """Whether two results may come from the same record.

    They do if a file has the same hash; and they may where one does not say what it came from.
    """
    return not a.inputs or not b.inputs or bool(set(a.inputs.values()) & set(b.inputs.values()))


def difference(a: Estimate, b: Estimate, *, independent: bool) -> Difference:
    """The second estimate less the first."""
    value = b.value - a.value
    below = _combined(b.value - b.low, a.high - a.value, independent)
    above = _combined(b.high - b.value, a.value - a.low, independent)
    z = _ratio(2.0 * value, below if value > 0.0 else above)
    return Difference(
        value=value,
        low=value - below,
        high=value + above,
        z=z,
        p_value=math.erfc(abs(z) / math.sqrt(2.0)) if not math.isnan(z) else math.nan,
        p_adjusted=math.nan,
        relative=100.0 * _ratio(value, abs(a.value)),
    )


def _combined(x: float, y: float, independent: bool) -> float:
    return math.hypot(x, y) if independent else x + y


def _ratio(difference: float, scale: float) -> float:
    """Their quotient; infinite where only the scale is zero."""
    if scale == 0.0:
        return math.copysign(math.inf, difference) if difference else 0.0
    return difference / scale


def holm(p: np.ndarray) -> np.ndarray:
    """Adjusted probabilities, same shape; NaN where there is no test."""
    p = np.asarray(p, dtype=float)
    adjusted = np.full(p.shape, np.nan)
    tested = np.flatnonzero(np.isfinite(p))
    order = tested[np.argsort(p[tested], kind="stable")]
    factors = np.arange(order.size, 0, -1)
    adjusted[order] = np.minimum(np.maximum.accumulate(factors * p[order]), 1.0)
    return adjusted
