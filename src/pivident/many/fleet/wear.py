"""Wear separated from temperature: change of a parameter with time at constant temperature.

Over all records, those of the baseline included,

    y_i = μ_r + w_r t_i + b (T_i - T₀) + u_i + e_i

with a level μ_r and a rate of wear w_r of each robot, and one slope b of temperature for the fleet.
Scatter of u and scale of y are those of the baseline. Temperature and wear are distinguishable as
far as temperature and time are not correlated; if they are, both intervals are wide.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pivident.many.fleet.baseline import Baseline
from pivident.many.fleet.control_chart import CONFIDENCE
from pivident.many.fleet.series import Series

#: Smallest share of a variable's spread that is not explained by the others.
SEPARATE = 1e-9


@dataclass(frozen=True)
class Rate:
    """A slope with its interval of 95 %."""

    value: float  # the slope
    low: float  # lower end
    high: float  # upper end

    def times(self, scale: float) -> Rate:
        """The same in another unit; ``scale`` is positive."""
        return Rate(scale * self.value, scale * self.low, scale * self.high)

    @property
    def clear(self) -> bool:
        """Whether it is significantly different from zero."""
        return self.low > 0.0 or self.high < 0.0


@dataclass(frozen=True)
class Wear:
    """Slopes of one parameter."""

    parameter: str  # its name
    unit: str  # its unit
    # b over the fleet [unit per unit of temperature]; None if unknown
    temperature: Rate | None
    # w of each robot [unit per unit of time]; None if its times do not differ
    robots: dict[str, Rate | None]
    level: float  # mean level of the robots
    degrees: int  # ν of the intervals


def separate_wear(baseline: Baseline) -> Wear:
    """Rates of wear and the slope of temperature of one parameter."""
    from scipy.stats import t

    degrees = max(baseline.degrees, 1)
    quantile = float(t.ppf(0.5 + CONFIDENCE / 2.0, degrees))
    warm = baseline.temperature is not None
    parts = [_Part.of(s, baseline.scatter, warm) for s in baseline.scaled]
    typical = baseline.typical_scale
    information = sum(p.warmth @ (p.weight * p.warmth) for p in parts)
    spread = sum(p.total for p in parts)
    slope, variance, temperature = 0.0, 0.0, None
    if warm and information > SEPARATE * spread:
        slope = float(sum(p.warmth @ (p.weight * p.value) for p in parts)) / float(information)
        variance = 1.0 / float(information)
        half = quantile * float(np.sqrt(variance))
        temperature = Rate(slope, slope - half, slope + half).times(typical)
    robots: dict[str, Rate | None] = {}
    for series, part, scale in zip(baseline.series, parts, baseline.scales, strict=True):
        if part.rate is None:
            robots[series.robot] = None
            continue
        rate = part.rate - slope * part.coupling
        half = quantile * float(np.sqrt(part.variance + variance * part.coupling**2))
        robots[series.robot] = Rate(rate, rate - half, rate + half).times(float(scale))
    first = baseline.series[0]
    level = float(np.nanmean(baseline.levels * baseline.scales))
    return Wear(first.parameter, first.unit, temperature, robots, level, degrees)


@dataclass(frozen=True, eq=False)
class _Part:
    """One robot after removing level and time from temperature and values."""

    weight: np.ndarray  # w, shape (records,)
    warmth: np.ndarray  # residual of the temperature
    value: np.ndarray  # values likewise
    total: float  # weighted spread of the temperature
    rate: float | None  # slope of the values over time alone; None where times do not differ
    variance: float  # of that slope
    coupling: float  # slope of temperature over time

    @classmethod
    def of(cls, series: Series, scatter: float, warm: bool) -> _Part:
        w = 1.0 / (scatter**2 + series.std**2)
        share = w / w.sum()
        y = series.value - share @ series.value
        warmth = series.temperature - share @ series.temperature if warm else np.zeros_like(y)
        time = series.position - share @ series.position
        total, spread = float(w @ warmth**2), float(w @ time**2)
        if np.ptp(series.position) <= 0.0:
            return cls(w, warmth, y, total, None, 0.0, 0.0)
        rate, coupling = float(w @ (time * y)) / spread, float(w @ (time * warmth)) / spread
        return cls(
            w, warmth - coupling * time, y - rate * time, total, rate, 1.0 / spread, coupling
        )
