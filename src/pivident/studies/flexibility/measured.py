"""A number with its unit and its interval."""

from __future__ import annotations

import math
from dataclasses import dataclass

#: Maximum number of decimals.
MAX_DECIMALS = 9


@dataclass(frozen=True)
class Measured:
    """An estimate of one quantity."""

    value: float  # the estimate, in SI
    low: float  # lower end of its 95 % interval
    high: float  # upper end; infinite if unbounded
    unit: str  # its unit

    @classmethod
    def around(cls, value: float, std: float, unit: str, factor: float = 2.0) -> Measured:
        """An estimate ± factor·std."""
        return cls(float(value), float(value - factor * std), float(value + factor * std), unit)

    @classmethod
    def inverse(cls, value: float, std: float, unit: str, factor: float = 2.0) -> Measured:
        """1/x for a positive quantity x; the upper end is unknown where x may be zero."""
        low, high = value - factor * std, value + factor * std
        best = 1.0 / value if value > 0 else math.inf
        least = 1.0 / high if high > 0 else math.inf
        return cls(best, least, 1.0 / low if low > 0 else math.inf, unit)

    @classmethod
    def unknown(cls, unit: str) -> Measured:
        """A quantity that the record does not determine: no value, no ends."""
        return cls(math.nan, -math.inf, math.inf, unit)

    @property
    def is_known(self) -> bool:
        """Whether there is a value or at least a lower end."""
        return math.isfinite(self.value) or math.isfinite(self.low)

    @property
    def clear(self) -> bool:
        """Whether zero is outside the interval."""
        return self.low > 0 or self.high < 0

    def times(self, factor: float, unit: str) -> Measured:
        """The same in another unit."""
        return Measured(self.value * factor, self.low * factor, self.high * factor, unit)

    def covers(self, value: float) -> bool:
        """Whether the interval contains a value."""
        return self.low <= value <= self.high

    def __str__(self) -> str:
        unit = f" {self.unit}" if self.unit else ""
        if not math.isfinite(self.value):
            return f"above {self.low:.3g}{unit}" if math.isfinite(self.low) else "not determined"
        value, low, high = _alike(self.value, self.low, self.high)
        return f"{value}{unit} (95 %: {low} to {high})"


def _alike(value: float, low: float, high: float) -> tuple[str, ...]:
    """Value and ends, to the second digit of half the interval and three digits of the value."""
    finite = [x for x in (value, low, high) if math.isfinite(x)]
    largest = max(map(abs, finite))
    width = max(finite) - min(finite)
    if not 1e-3 <= largest < 1e7 or width == 0.0:
        return tuple(f"{x:.3g}" for x in (value, low, high))
    decimals = 1 - math.floor(math.log10(0.5 * width))
    decimals = min(max(decimals, 2 - math.floor(math.log10(largest))), MAX_DECIMALS)
    # + 0.0 makes 0 of -0; tens and hundreds are rounded too
    return tuple(f"{round(x, decimals) + 0.0:.{max(decimals, 0)}f}" for x in (value, low, high))
