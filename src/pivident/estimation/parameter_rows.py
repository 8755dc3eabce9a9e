"""One estimated parameter per row: what tables, files and reports have in common."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

from pivident.estimation.identification import Identification

#: Estimates further apart than this many combined standard deviations contradict each other.
CONTRADICTION = 3.0

#: Numbers of so many decimals, or as large as this, are written with an exponent.
_MANY_DECIMALS, _LARGE = 7, 1e6

#: … unless they are larger than this, where an exponent would only hide their size.
_SMALL = 1e-3


@dataclass(frozen=True)
class ParameterRow:
    """One estimate.

    Attributes:
        name: base parameter.
        value: estimate [unit].
        std: standard deviation by the method's covariance [unit].
        robust_std: standard deviation by the sandwich [unit].
        relative_std: 100 σ/|θ| [%].
        unit: unit of the parameter.
        expression: its group written out.
        truth: known value [unit], NaN where none is known.
    """

    name: str
    value: float
    std: float
    robust_std: float
    relative_std: float
    unit: str
    expression: str
    truth: float = math.nan

    @property
    def error_percent(self) -> float:
        """100 (θ̂ - θ)/|θ| [%], NaN without a truth or where it is zero."""
        return 100.0 * (self.value - self.truth) / abs(self.truth) if self.truth else math.nan

    @property
    def error_sigmas(self) -> float:
        """(θ̂ - θ)/σ, NaN without a truth."""
        return _ratio(self.value - self.truth, self.std)

    @property
    def includes_zero(self) -> bool:
        """Whether zero lies within ±2σ."""
        return abs(self.value) <= 2.0 * self.std


def parameter_rows(
    identification: Identification, truth: Mapping[str, float] | None = None
) -> tuple[ParameterRow, ...]:
    """The estimates of one identification, in its order.

    Args:
        identification: the result.
        truth: known values by parameter name, with or without the trailing ``r``.
    """
    known = {name.lower(): float(value) for name, value in (truth or {}).items()}
    columns = zip(
        identification.names,
        identification.parameters,
        identification.theta,
        identification.std,
        identification.robust_std,
        identification.relative_std,
        identification.expressions,
        strict=True,
    )
    return tuple(
        ParameterRow(
            name=name,
            value=float(value),
            std=float(std),
            robust_std=float(robust),
            relative_std=float(relative),
            unit=parameter.unit,
            expression=expression,
            truth=known.get(name.lower(), known.get(parameter.name.lower(), math.nan)),
        )
        for name, parameter, value, std, robust, relative, expression in columns
    )


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

    Returns:
        Difference in combined standard deviations, i and j; (0, 0, 0) with fewer than two rows.
    """
    best = (0.0, 0, 0)
    present = [(k, row) for k, row in enumerate(rows) if row is not None]
    for (i, a), (j, b) in combinations(present, 2):
        distance = _ratio(abs(a.value - b.value), math.hypot(a.std, b.std))
        if distance > best[0]:
            best = (distance, i, j)
    return best


def significant(x: float, digits: int = 3) -> str:
    """A number with a few significant digits: ``0.0123``, ``1.23e-07``, ``–`` for NaN."""
    if not math.isfinite(x):
        return "–" if math.isnan(x) else "∞" if x > 0 else "-∞"
    if x == 0.0:
        return "0"
    decimals = max(0, digits - 1 - _exponent(x))
    return f"{x:.{decimals}f}" if _is_plain(abs(x), decimals) else f"{x:.{digits - 1}e}"


def known(x: float) -> str:
    """A number that is known exactly, with the digits it has, six at most."""
    return f"{x:.6g}" if math.isfinite(x) else significant(x)


def with_spread(value: float, spread: float) -> tuple[str, str]:
    """A value and its ± spread, both to the second digit of the spread.

    Args:
        value: the value.
        spread: such as 2σ.
    """
    if not (math.isfinite(value) and math.isfinite(spread) and spread > 0.0):
        return significant(value, 5), significant(spread, 2)
    decimals = max(0, 1 - _exponent(spread))
    size = max(abs(value), spread)
    if _is_plain(size, decimals):
        return f"{round(value, decimals) + 0.0:.{decimals}f}", f"{spread:.{decimals}f}"  # no -0.0
    power = _exponent(size)
    digits = max(0, 1 - _exponent(spread) + power)
    mantissas = (f"{x / 10.0**power:.{digits}f}" for x in (value, spread))
    text, spread_text = (f"{mantissa}e{power:+03d}" for mantissa in mantissas)
    return text, spread_text


def plus_minus(value: float, spread: float, sign: bool = False) -> str:
    """``0.123 ± 0.045``: a value and its spread in matching digits; the value where none is known.

    Args:
        value: the value.
        spread: such as 2σ; none where it is zero or NaN.
        sign: whether a positive value is written with its sign.
    """
    text, spread_text = with_spread(value, spread)
    text = f"+{text}" if sign and not text.startswith("-") else text
    return f"{text} ± {spread_text}" if spread > 0.0 else text


def percent(x: float) -> str:
    """A percentage: ``1.2 %``."""
    return significant(x, 2) if math.isnan(x) else f"{significant(x, 2)} %"


def _is_plain(size: float, decimals: int) -> bool:
    """Whether a number of this size and so many decimals reads well without an exponent."""
    return size < _LARGE and (decimals < _MANY_DECIMALS or size >= _SMALL)


def _exponent(x: float) -> int:
    return math.floor(math.log10(abs(x)))


def _ratio(difference: float, scale: float) -> float:
    """Their quotient; infinite where only the scale is zero."""
    if scale == 0.0:
        return difference * math.inf if difference else 0.0
    return difference / scale
