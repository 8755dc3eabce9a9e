"""Control charts: changes of a parameter from its baseline, sudden, slow, or by wear.

Each record after the baseline is tested twice (d and C are those of `baseline`):

    Shewhart   z_i = d_i / √C_ii                                      a sudden change
    EWMA       m_i = Σ a_j d_j,   z_i = m_i / √(aᵀ C a)               a slow one

where a_j ∝ (1 - λ)^(i - j) / C_jj over the records up to i, and Σ a_j = 1: an exponentially
weighted mean that gives accurate records more weight. Without a change both follow Student's t with
ν degrees of freedom; C includes the error of the baseline.

With m tests in all (two for each record, parameter and robot), an alarm needs |z| above the
quantile t(1 - level/(2m)). By Bonferroni's inequality the probability of one false alarm or more,
anywhere in the fleet and the period, is at most the level for any dependence between the tests.

Wear separated from temperature: change of a parameter with time at constant temperature.

Over all records, those of the baseline included,

    y_i = μ_r + w_r t_i + b (T_i - T₀) + u_i + e_i

with a level μ_r and a rate of wear w_r of each robot, and one slope b of temperature for the fleet.
Scatter of u and scale of y are those of the baseline. Temperature and wear are distinguishable as
far as temperature and time are not correlated; if they are, both intervals are wide.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pivident.foundation.distributions import student
from pivident.studies.many.fleet.baseline import Baseline, Expectation
from pivident.studies.many.fleet.series import Series

#: λ, the weight of the newest record among equally accurate ones.
FORGETTING = 0.3
#: Tests of one record.
TESTS = 2
#: Confidence of the intervals of changes and slopes.
CONFIDENCE = 0.95
#: Smallest share of a variable's spread that is not explained by the others.
SEPARATE = 1e-9


@dataclass(frozen=True, eq=False)
class Chart:
    """The chart of one parameter of one robot; arrays over the judged records."""

    series: Series  # the estimates
    first: int  # index of the first record that is judged
    baseline_values: np.ndarray  # records before it, at the reference temperature, shape (first,)
    level: float  # level of the baseline [unit of the parameter], at the reference temperature
    level_std: float  # its standard error
    degrees: int  # degrees of freedom
    difference: np.ndarray  # d, record minus expectation
    std: np.ndarray  # √C_ii
    mean: np.ndarray  # exponentially weighted mean of d
    mean_std: np.ndarray  # its standard error
    covariance: np.ndarray  # C
    limit: float  # |z| that gives an alarm
    tests: int  # m, number of tests in the family

    @property
    def sudden(self) -> np.ndarray:
        """Shewhart's z."""
        return self.difference / self.std

    @property
    def slow(self) -> np.ndarray:
        """The z of the exponentially weighted mean."""
        return self.mean / self.mean_std

    @property
    def outside(self) -> np.ndarray:
        """Records with an alarm."""
        return (np.abs(self.sudden) > self.limit) | (np.abs(self.slow) > self.limit)


@dataclass(frozen=True)
class Alarm:
    """A significant change of a parameter."""

    robot: str
    joint: str  # joint of the parameter
    parameter: str  # its name
    unit: str  # of change and level
    log: str  # the first record outside
    time: str  # time of that record
    charts: tuple[str, ...]  # ``shewhart``, ``ewma`` or both, at that record
    change: float  # mean change from that record on
    low: float  # lower end of its interval of 95 %
    high: float  # upper end
    level: float  # of the baseline
    records: int  # number of records behind the change
    p_value: float  # upper bound of the probability of such a z in the fleet without any change

    @property
    def relative(self) -> tuple[float, float, float]:
        """Change and its interval as shares of the level."""
        size = abs(self.level) or np.nan
        return self.change / size, self.low / size, self.high / size


def draw_charts(
    baselines: Sequence[Baseline], level: float, planned: int | None = None
) -> list[Chart]:
    """Charts of all parameters and robots with records after the baseline.

    ``level``: probability of one false alarm or more in the whole fleet and period, at most.
    ``planned``: judged records of each robot in the whole period; None: those that are there.
    """
    expected: list[tuple[Series, Expectation, int]] = []
    for baseline in baselines:
        for number, series in enumerate(baseline.series):
            expectation = baseline.expectation(number)
            if expectation is not None:
                expected.append((series, expectation, baseline.degrees_of(number)))
    tests = number_of_tests(baselines, [e.difference.size for _, e, _ in expected], planned)
    limits = {
        degrees: float(student.isf(level / (2.0 * tests), degrees))
        for degrees in {degrees for *_, degrees in expected}
    }
    return [_chart(s, e, degrees, limits[degrees], tests) for s, e, degrees in expected]


def number_of_tests(
    baselines: Sequence[Baseline], judged: Sequence[int], planned: int | None
) -> int:
    """m: two tests for each judged record of each parameter and robot."""
    if planned is None:
        return TESTS * max(1, sum(judged))
    return TESTS * sum(len(b.series) for b in baselines) * max([planned, *judged])


def find_alarms(charts: Sequence[Chart]) -> list[Alarm]:
    """One alarm for each chart with records outside, the clearest first."""
    found = [_alarm(chart) for chart in charts if chart.outside.any()]
    return sorted(found, key=lambda a: (a.p_value, a.robot, a.parameter))


def _chart(series: Series, expected: Expectation, degrees: int, limit: float, tests: int) -> Chart:
    d, c = expected.difference, expected.covariance
    age = np.subtract.outer(np.arange(d.size), np.arange(d.size))
    weights = np.where(age >= 0, (1.0 - FORGETTING) ** np.maximum(age, 0), 0.0) / np.diag(c)
    weights /= weights.sum(axis=1, keepdims=True)
    mean_std = np.sqrt(np.einsum("ij,jk,ik->i", weights, c, weights))
    return Chart(
        series, expected.first, expected.baseline_values, expected.level, expected.level_std,
        degrees, d, np.sqrt(np.diag(c)), weights @ d, mean_std, c, limit, tests,
    )  # fmt: skip


def _alarm(chart: Chart) -> Alarm:
    """The first record outside, and the mean change from there on."""
    start = int(np.argmax(chart.outside))
    charts = tuple(
        name
        for name, z in (("shewhart", chart.sudden), ("ewma", chart.slow))
        if abs(z[start]) > chart.limit
    )
    c = chart.covariance[start:, start:]
    weights = 1.0 / np.diag(c)
    weights /= weights.sum()
    change = float(weights @ chart.difference[start:])
    half = float(
        np.sqrt(weights @ c @ weights) * student.ppf(0.5 + CONFIDENCE / 2.0, chart.degrees)
    )
    largest = float(np.max(np.abs([chart.sudden, chart.slow])))
    series, record = chart.series, chart.first + start
    return Alarm(
        series.robot, series.joint, series.parameter, series.unit, series.logs[record],
        series.times[record], charts, change, change - half, change + half, chart.level,
        weights.size, min(1.0, chart.tests * 2.0 * float(student.sf(largest, chart.degrees))),
    )  # fmt: skip


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
    degrees = max(baseline.degrees, 1)
    quantile = float(student.ppf(0.5 + CONFIDENCE / 2.0, degrees))
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
