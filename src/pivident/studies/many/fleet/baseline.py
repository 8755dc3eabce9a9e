"""Baseline of a parameter: its level before any change, and the scatter between records.

The model of record i of robot r, taken at the temperature T_i, is

    y_i = μ_r + b (T_i - T₀) + u_i + e_i,      u_i ~ N(0, τ²),   e_i ~ N(0, s_i²)

with the standard error s_i of the estimate, and a scatter τ between records that is not part of
the interval of a single record: warm-up, grease, model error that depends on the motion. This is
the random-effects model of meta-analysis. The level μ_r is that of the robot, slope b and scatter τ
are common to all robots of the fleet. τ² is that of Paule and Mandel (1982): with
w_i = 1/(τ² + s_i²), the weighted sum of squares about the fit,

    Q(τ²) = Σ w_i (y_i - μ̂_r - b̂ (T_i - T₀))² = ν,      ν = records - robots - 1

equals its degrees of freedom ν; τ² = 0 if Q(0) is below. The error d_i = y_i - ŷ_i of a later
record of robot r has the covariance

    C = diag(τ² + s²) + 11ᵀ/W_r + var(b̂) g gᵀ,      W_r = Σ w,   g_i = T_i - T̄_r

and d/√C is compared with Student's t of ν degrees of freedom. This is exact for equally accurate
records, and conservative if τ² = 0.

Change with temperature and scatter of friction are proportional to its level. If a parameter is
clearly different from zero in all robots, y is therefore divided by the robot's level at T₀, which
is found in a few passes; its own error, of second order, is neglected. Results are in the unit of
the parameter.

``baseline = "fleet"`` compares a robot with the others: its level is the mean of theirs, and the
scatter σ² between robots (Paule and Mandel again, of their levels) is added as a common error of
all its records. ν is then the number of other robots minus one.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from pivident.studies.many.fleet.series import Series

#: Smallest ratio of a level to the standard error of each of its records for relative values.
CLEAR = 10.0

#: Passes that find the levels by which values are divided.
PASSES = 4

#: Relative accuracy of τ².
TOLERANCE = 1e-12


@dataclass(frozen=True)
class Temperature:
    """Change of a parameter with temperature, the same for all robots."""

    slope: float  # b [unit of the scaled parameter per unit of the temperature]
    std: float  # its standard error
    reference: float  # T₀


@dataclass(frozen=True, eq=False)
class Expectation:
    """Expectation of the later records of one robot by the baseline."""

    first: int  # index of the first record that is judged
    baseline_values: np.ndarray  # records before it at T₀, shape (first,)
    level: float  # level of the robot at T₀
    level_std: float  # its standard error
    difference: np.ndarray  # d, records minus expectation, shape (judged,)
    covariance: np.ndarray  # C, shape (judged, judged)


@dataclass(frozen=True, eq=False)
class Baseline:
    """The baseline of one parameter over all robots."""

    series: tuple[Series, ...]  # of each robot
    # divisors of values and standard errors of each robot, shape (robots,); scatter, slope,
    # levels and weights are those of the scaled values
    scales: np.ndarray
    kind: str  # ``robot`` or ``fleet``
    scatter: float  # τ, standard deviation between records of one robot
    degrees: int  # ν of that scatter
    # change with temperature; None where it is not known or did not change
    temperature: Temperature | None
    levels: np.ndarray  # μ̂ at T₀ of each robot, NaN without a baseline, shape (robots,)
    weights: np.ndarray  # W_r, likewise
    centres: np.ndarray  # T̄_r, likewise

    @cached_property
    def scaled(self) -> tuple[Series, ...]:
        """The series divided by their scales."""
        return _scaled(self.series, self.scales)

    @property
    def typical_scale(self) -> float:
        """Mean of the scales, which turns scatter and slope into the unit of the parameter."""
        return float(np.mean(self.scales))

    def expectation(self, number: int) -> Expectation | None:
        """Errors of a robot's later records in the unit of the parameter, None without any."""
        found = self._among_others(number) if self.kind == "fleet" else self._by_itself(number)
        if found is None:
            return None
        scale = float(self.scales[number])
        return Expectation(
            found.first,
            scale * found.baseline_values,
            scale * found.level,
            scale * found.level_std,
            scale * found.difference,
            scale**2 * found.covariance,
        )

    def _by_itself(self, number: int) -> Expectation | None:
        own = self.scaled[number]
        first = own.baseline
        if own.records <= first or self.degrees < 1:
            return None
        slope, variance = self._slope
        warmth = self._temperature(own)
        gap = warmth[first:] - self.centres[number]
        plain = own.value - slope * (warmth - self._reference)  # at T₀
        inner = self.scatter**2 + own.std[first:] ** 2
        covariance = np.diag(inner) + 1.0 / self.weights[number] + variance * np.outer(gap, gap)
        shift = self.centres[number] - self._reference
        level_std = float(np.sqrt(1.0 / self.weights[number] + variance * shift**2))
        level = float(self.levels[number])
        return Expectation(
            first, plain[:first], level, level_std, plain[first:] - level, covariance
        )

    def degrees_of(self, number: int) -> int:
        """Degrees of freedom of the errors of a robot's records."""
        if self.kind == "robot":
            return self.degrees
        others = int(np.isfinite(np.delete(self.levels, number)).sum()) - 1
        return min(others, self.degrees) if self.degrees > 0 else others

    def _among_others(self, number: int) -> Expectation | None:
        levels, weights = np.delete(self.levels, number), np.delete(self.weights, number)
        usable = np.isfinite(levels)
        levels, variances = levels[usable], 1.0 / weights[usable]
        if levels.size < 2 or self.degrees_of(number) < 1:
            return None

        def excess(between: float) -> float:
            w = 1.0 / (between + variances)
            return float(w @ (levels - w @ levels / w.sum()) ** 2) - (levels.size - 1)

        between = paule_mandel(excess, float(levels.var()))
        w = 1.0 / (between + variances)
        level, own = float(w @ levels / w.sum()), self.scaled[number]
        slope, variance = self._slope
        gap = self._temperature(own) - self._reference
        inner = self.scatter**2 + own.std**2
        covariance = np.diag(inner) + between + 1.0 / float(w.sum()) + variance * np.outer(gap, gap)
        level_std = float(np.sqrt(between + 1.0 / w.sum()))
        difference = own.value - level - slope * gap
        return Expectation(0, difference[:0], level, level_std, difference, covariance)

    def _temperature(self, own: Series) -> np.ndarray:
        return np.zeros(own.records) if self.temperature is None else own.temperature

    @property
    def _reference(self) -> float:
        return 0.0 if self.temperature is None else self.temperature.reference

    @property
    def _slope(self) -> tuple[float, float]:
        """b̂ and its variance."""
        t = self.temperature
        return (0.0, 0.0) if t is None else (t.slope, t.std**2)


def fit_baseline(
    series: Sequence[Series], kind: str = "robot", relative: bool | None = None
) -> Baseline:
    """The baseline of one parameter.

    ``kind``: ``robot`` gives each its own level, ``fleet`` compares it with the others.
    ``relative``: values are divided by the robot's level; None: if each robot has its own and all
    are clearly different from zero.
    """
    scales = np.ones(len(series))
    found = _fitted(series, scales, kind)
    if relative is None:
        relative = kind == "robot" and all(
            abs(level) > CLEAR * own.std[: own.baseline].max()
            for level, own in zip(found.levels, series, strict=True)
        )
    for _ in range(PASSES if relative else 0):
        scales = scales * np.abs(found.levels)
        found = _fitted(series, scales, kind)
    return found


def _scaled(series: Sequence[Series], scales: np.ndarray) -> tuple[Series, ...]:
    return tuple(
        replace(own, value=own.value / scale, std=own.std / scale)
        for own, scale in zip(series, scales, strict=True)
    )


def _fitted(original: Sequence[Series], scales: np.ndarray, kind: str) -> Baseline:
    """The baseline of values divided by given scales."""
    series = _scaled(original, scales)
    first = [min(s.baseline, s.records) for s in series]
    robot = np.repeat(np.arange(len(series)), first)
    y, s, t = (
        np.concatenate([getattr(own, key)[:k] for own, k in zip(series, first, strict=True)])
        for key in ("value", "std", "temperature")
    )
    known = all(np.isfinite(own.temperature).all() for own in series)
    fit = _Regression(robot, len(series), y, s, t if known else None)
    scatter = 0.0
    if fit.degrees > 0:
        scatter = paule_mandel(fit.excess, float(np.var(y - fit.means(y, np.ones_like(y))[robot])))
    weights, centres, levels, slope, variance = fit.solved(scatter)
    temperature = None
    if fit.warm:
        reference = float(np.mean(t))
        temperature = Temperature(slope, float(np.sqrt(variance)), reference)
        levels = levels - slope * (centres - reference)
    return Baseline(
        tuple(original), scales, kind, float(np.sqrt(scatter)), fit.degrees, temperature, levels,
        weights, centres,
    )  # fmt: skip


def paule_mandel(excess: Callable[[float], float], scale: float) -> float:
    """The variance τ² ≥ 0 at which Q(τ²) - ν, falling with τ², is zero or starts negative."""
    from scipy.optimize import brentq

    if excess(0.0) <= 0.0:
        return 0.0
    high = scale or 1e-300
    while excess(high) > 0.0:
        high *= 4.0
    return float(brentq(excess, 0.0, high, xtol=TOLERANCE * high, rtol=TOLERANCE))


class _Regression:
    """Levels of all robots and one slope, for any τ²."""

    def __init__(
        self, robot: np.ndarray, robots: int, y: np.ndarray, s: np.ndarray, t: np.ndarray | None
    ) -> None:
        self.robot, self.robots, self.y, self.s = robot, robots, y, s
        self.t = np.zeros_like(y) if t is None else t
        within = self.t - self.means(self.t, np.ones_like(y))[robot]
        present = int((np.bincount(robot, minlength=robots) > 0).sum())
        # a slope needs different temperatures within a robot, and a spare degree of freedom
        self.warm = t is not None and bool(np.ptp(within) > 0.0) and y.size - present > 1
        if not self.warm:
            self.t = np.zeros_like(y)
        self.degrees = y.size - present - int(self.warm)

    def means(self, x: np.ndarray, w: np.ndarray) -> np.ndarray:
        """Weighted mean of each robot, NaN without records."""
        total = np.bincount(self.robot, weights=w, minlength=self.robots)
        with np.errstate(invalid="ignore"):
            return np.bincount(self.robot, weights=w * x, minlength=self.robots) / total

    def solved(self, scatter: float) -> tuple[np.ndarray, np.ndarray, np.ndarray, float, float]:
        """W_r, T̄_r, ȳ_r, b̂ and var(b̂) for τ²."""
        w = 1.0 / (scatter + self.s**2)
        weights = np.bincount(self.robot, weights=w, minlength=self.robots)
        centres, levels = self.means(self.t, w), self.means(self.y, w)
        if not self.warm:
            return weights, centres, levels, 0.0, 0.0
        g = self.t - centres[self.robot]
        information = float(w @ g**2)
        slope = float(w @ (g * (self.y - levels[self.robot]))) / information
        return weights, centres, levels, slope, 1.0 / information

    def excess(self, scatter: float) -> float:
        """Q(τ²) - ν."""
        w = 1.0 / (scatter + self.s**2)
        _, centres, levels, slope, _ = self.solved(scatter)
        error = self.y - levels[self.robot] - slope * (self.t - centres[self.robot])
        return float(w @ error**2) - self.degrees
