"""One estimated parameter per row: what tables, files and reports have in common."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

from pivident.data.logs.torque_scale import OUTPUT_UNIT, is_ratio
from pivident.estimation.identification import Identification
from pivident.foundation.text.numbers import format_significant, with_spread

#: Estimates further apart than this many combined standard errors contradict each other.
CONTRADICTION = 3.0


@dataclass(frozen=True)
class ParameterRow:
    """One estimate."""

    name: str  # base parameter
    value: float  # estimate [unit]
    std: float  # standard error of the interval, see `Identification.std` [unit]
    method_std: float  # standard error by the method's covariance [unit]
    unit: str  # unit of the parameter
    expression: str  # its group written out
    truth: float = math.nan  # known value [unit], NaN where none is known
    bound: str = ""  # ``low`` or ``high`` where a bound holds the estimate, ``fixed`` where it is

    @property
    def relative_std(self) -> float:
        """100 σ/|θ| [%]; infinite for an estimate of zero."""
        return 100.0 * self.std / abs(self.value) if self.value else math.inf

    @property
    def error_percent(self) -> float:
        """100 (θ̂ - θ)/|θ| [%], NaN without a truth or where it is zero."""
        return 100.0 * (self.value - self.truth) / abs(self.truth) if self.truth else math.nan

    @property
    def error_sigmas(self) -> float:
        """(θ̂ - θ)/σ, NaN without a truth."""
        return _ratio(self.value - self.truth, self.std)

    def interval(self, std: float | None = None) -> tuple[float, float]:
        """Value ± 2σ, of one side where a bound holds the value; ``std``: another σ."""
        half = 2.0 * (self.std if std is None else std)
        return (
            self.value if self.bound == "low" else self.value - half,
            self.value if self.bound == "high" else self.value + half,
        )

    @property
    def low(self) -> float:
        """Lower end of the interval [unit]."""
        return self.interval()[0]

    @property
    def high(self) -> float:
        """Upper end of the interval [unit]."""
        return self.interval()[1]

    @property
    def value_and_spread(self) -> tuple[str, str]:
        """Value and 2σ as text; the latter with a sign where the interval has that side only."""
        if self.bound == "fixed":
            return format_significant(self.value, 5), "fixed"
        value, spread = with_spread(self.value, 2.0 * self.std)
        return value, {"low": "+", "high": "−"}.get(self.bound, "") + spread

    @property
    def in_words(self) -> str:
        """Value, 2σ and unit, such as ``1.2 ± 0.1 kg``, or ``0 +0.1 kg`` at a bound."""
        value, spread = self.value_and_spread
        if self.bound == "fixed":
            return f"{value} {self.unit} (fixed)"
        return f"{value} {'' if self.bound else '± '}{spread} {self.unit}"

    @property
    def includes_zero(self) -> bool:
        """Whether zero lies within the interval of ±2σ."""
        return self.low <= 0.0 <= self.high


@dataclass(frozen=True)
class ParameterRange:
    """Between which values an estimate lies over blocks of the motion, or over friction laws."""

    name: str  # base parameter
    low: float  # least value [unit of the parameter]
    high: float  # largest value
    by: str  # over what: ``blocks``, ``recordings`` or ``friction laws``
    estimates: int  # how many estimates it comes from
    by_noise: float = 0.0  # width that noise alone exceeds in one of a hundred results [unit]


def range_texts(names: Sequence[str], ranges: Sequence[ParameterRange]) -> list[str]:
    """The range of each parameter over everything, such as ``7.1 … 8.7``; empty without one."""
    texts = []
    for name in names:
        own = [r for r in ranges if r.name == name and r.high > r.low]
        ends = [min(r.low for r in own), max(r.high for r in own)] if own else []
        texts.append(" … ".join(with_spread(end, 0.5 * (ends[1] - ends[0]))[0] for end in ends))
    return texts


def parameter_rows(
    identification: Identification, truth: Mapping[str, float] | None = None
) -> tuple[ParameterRow, ...]:
    """The estimates of one identification, in its order.

    A parameter that nothing determines and that was held has no standard error: NaN.
    """
    simulation = identification.simulation
    held = set() if simulation is None else set(simulation.held)
    known = {name.lower(): float(value) for name, value in (truth or {}).items()}
    fixed = identification.restrictions.is_fixed
    columns = zip(
        identification.names,
        identification.parameters,
        parameter_units(identification),
        identification.theta,
        identification.std,
        identification.method_std,
        identification.expressions,
        (
            "fixed" if own else side
            for own, side in zip(fixed, identification.bound_sides, strict=True)
        ),
        strict=True,
    )
    return tuple(
        ParameterRow(
            name=name,
            value=float(value),
            std=math.nan if name in held else float(std),
            method_std=math.nan if name in held else float(own),
            unit=unit,
            expression=expression,
            truth=known.get(name.lower(), known.get(parameter.name.lower(), math.nan)),
            bound=side,
        )
        for name, parameter, unit, value, std, own, expression, side in columns
    )


def parameter_units(identification: Identification) -> tuple[str, ...]:
    """Unit of each estimate: that of the parameter, over that of a drive gain nobody knows.

    Args:
        identification: the result.

    Returns:
        Such as ``kg m²``, or ``kg m²/(N m/output)``.
    """
    units = tuple(parameter.unit for parameter in identification.parameters)
    if not is_ratio(identification.torque_scale):
        return units
    joints = identification.robot.tree.joints
    torques = (joints[p.joint].torque_unit for p in identification.parameters)
    return tuple(f"{u}/({t}/{OUTPUT_UNIT})" for u, t in zip(units, torques, strict=True))


def method_labels(identifications: Sequence[Identification]) -> tuple[str, ...]:
    """Name of each method, numbered where a method appears more than once."""
    methods = [identification.method for identification in identifications]
    total, seen = Counter(methods), Counter[str]()
    labels = []
    for method in methods:
        seen[method] += 1
        labels.append(f"{method} ({seen[method]})" if total[method] > 1 else method)
    return tuple(labels)


def aligned_rows(
    identifications: Sequence[Identification], truth: Mapping[str, float] | None = None
) -> dict[str, tuple[ParameterRow | None, ...]]:
    """Rows of several identifications by parameter name; None where one lacks a parameter."""
    tables = [{row.name: row for row in parameter_rows(i, truth)} for i in identifications]
    names = dict.fromkeys(name for table in tables for name in table)
    return {name: tuple(table.get(name) for table in tables) for name in names}


def largest_difference(rows: Sequence[ParameterRow | None]) -> tuple[float, int, int]:
    """Largest |θ_i - θ_j| / √(σ_i² + σ_j²) of one parameter, and the two rows concerned.

    The estimates share their record, so their errors are not independent; as a rule they are
    correlated positively, and the ratio is then on the small side.

    Result: difference in combined standard errors, i and j; (0, 0, 0) with fewer than two rows.
    """
    best = (0.0, 0, 0)
    present = [(k, row) for k, row in enumerate(rows) if row is not None]
    for (i, a), (j, b) in combinations(present, 2):
        distance = _ratio(abs(a.value - b.value), math.hypot(a.std, b.std))
        if distance > best[0]:
            best = (distance, i, j)
    return best


def _ratio(difference: float, scale: float) -> float:
    """Their quotient; infinite where only the scale is zero."""
    if scale == 0.0:
        return difference * math.inf if difference else 0.0
    return difference / scale
