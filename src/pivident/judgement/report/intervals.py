"""Estimates with their ±2σ intervals as small drawings, in percent of their width.

Parameters differ by orders of magnitude and by unit, so each one gets a scale of its own. Methods
differ in colour and in the shape of their marker; consistent estimates have rows of their
own below, with hollow markers.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from pivident.estimation.parameter_rows import ParameterRow
from pivident.foundation.text.numbers import format_exact, with_spread

#: Free space left and right of the drawing [% of its width].
_MARGIN = 6.0

#: A nominal value farther away than this, in widths of all intervals, is only pointed at.
_FAR = 1.5

#: Outlines of the methods' markers about their middle [px]: dot, square, diamond, triangles up and
#: down, cross, triangles to both sides, bars upright and lying.
MARKERS = (
    "M-3.2 0a3.2 3.2 0 1 0 6.4 0a3.2 3.2 0 1 0-6.4 0z",
    "M-2.9-2.9h5.8v5.8h-5.8z",
    "M0-4.2l4.2 4.2l-4.2 4.2l-4.2-4.2z",
    "M0-3.9l3.9 6.6h-7.8z",
    "M0 3.9l3.9-6.6h-7.8z",
    "M-1.3-4h2.6v2.7h2.7v2.6h-2.7v2.7h-2.6v-2.7h-2.7v-2.6h2.7z",
    "M3.9 0l-6.6 3.9v-7.8z",
    "M-3.9 0l6.6 3.9v-7.8z",
    "M-1.5-4h3v8h-3z",
    "M-4-1.5h8v3h-8z",
)


def marker(method: int) -> str:
    """Outline of a method's marker, by the method's index; they repeat with the colours."""
    return MARKERS[method % len(MARKERS)]


@dataclass(frozen=True)
class Interval:
    """One estimate on the drawing's scale, 0 to 100."""

    method: int  # index of the method, which is its colour and its marker
    middle: float
    left: float  # estimate - 2σ, or the lower end of a consistent estimate's interval
    right: float  # the other end
    words: str = ""  # name, value, interval and unit
    consistent: bool = False  # whether it is a consistent estimate


@dataclass(frozen=True)
class IntervalDrawing:
    """Intervals of one parameter."""

    #: one per method that estimates it, then one per consistent estimate
    intervals: tuple[Interval, ...]
    zero: float | None  # place of zero, None where it lies outside
    truth: float | None  # place of the known value, None where it is not known
    low: str  # what stands at the left edge of the scale
    high: str  # what stands at the right edge
    label: str  # the drawing in words
    #: place of the nominal (CAD) value, at an edge where it lies outside; None where it is not
    #: known
    nominal: float | None = None
    beyond: int = 0  # -1 or 1 where the nominal value lies outside, to the left or to the right


@dataclass(frozen=True)
class ConsistentValue:
    """A consistent estimate of one parameter."""

    method: int  # index of the method whose estimate was made consistent
    label: str  # name in tables
    value: float
    #: lower end of its interval; infinite where nothing bounds it, NaN where it is unknown
    low: float
    high: float  # upper end


def interval_drawing(
    rows: Sequence[ParameterRow | None],
    labels: Sequence[str],
    *,
    with_zero: bool,
    consistent: Sequence[ConsistentValue] = (),
    nominal: float = math.nan,
) -> IntervalDrawing:
    """Place the intervals of one parameter on a common scale.

    ``rows`` holds one estimate per method, None where there is none; ``nominal`` may be NaN.
    """
    present = [(k, row) for k, row in enumerate(rows) if row is not None]
    unit, truth = present[0][1].unit, present[0][1].truth
    ends = [end for _, row in present for end in _ends(row)] + [own.value for own in consistent]
    marks = ([0.0] if with_zero else []) + ([truth] if math.isfinite(truth) else [])
    low, high = min(ends + marks), max(ends + marks)
    width = (high - low) or abs(high) or 1.0
    if low - _FAR * width <= nominal <= high + _FAR * width:
        low, high = min(low, nominal), max(high, nominal)
    extent = (high - low) or abs(high) or 1.0

    def place(x: float) -> float:
        if math.isnan(x):
            return _MARGIN
        x = min(max(x, low - extent), high + extent)
        share = _MARGIN + (100.0 - 2.0 * _MARGIN) * (x - low) / extent
        return round(min(max(share, 0.0), 100.0), 2)

    words = [f"{labels[k]} {row.in_words}" for k, row in present]
    own_words = [f"{own.label} {known_interval(own)} {unit}" for own in consistent]
    known_values = [
        f"{name} {format_exact(x)} {unit}"
        for name, x in (("true value", truth), ("nominal", nominal))
        if math.isfinite(x)
    ]
    beyond = 0 if low <= nominal <= high or math.isnan(nominal) else 1 if nominal > high else -1
    return IntervalDrawing(
        intervals=(
            *(
                _estimate(k, row, place, text)
                for (k, row), text in zip(present, words, strict=True)
            ),
            *(
                _consistent(own, place, text)
                for own, text in zip(consistent, own_words, strict=True)
            ),
        ),
        zero=place(0.0) if low <= 0.0 <= high else None,
        truth=place(truth) if math.isfinite(truth) else None,
        low=with_spread(low, extent / 10.0)[0],
        high=with_spread(high, extent / 10.0)[0],
        label=f"{present[0][1].name}: {'; '.join([*words, *own_words, *known_values])}",
        nominal=(0.0, place(nominal), 100.0)[beyond + 1] if math.isfinite(nominal) else None,
        beyond=beyond,
    )


def known_interval(own: ConsistentValue) -> str:
    """Value and interval in words; an end that nothing bounds is open."""
    ends = ["open" if not math.isfinite(end) else format_exact(end) for end in (own.low, own.high)]
    return f"{format_exact(own.value)} (95 %: {' to '.join(ends)})"


def _estimate(method: int, row: ParameterRow, place, words: str) -> Interval:
    """An estimate with its interval."""
    left, right = map(place, _ends(row))
    return Interval(method, place(row.value), left, right, words)


def _consistent(own: ConsistentValue, place, words: str) -> Interval:
    """A consistent estimate; an end that is open or unknown is left at the value or the edge."""
    left, right = (own.value if math.isnan(end) else end for end in (own.low, own.high))
    middle, left, right = place(own.value), place(left), place(right)
    return Interval(own.method, middle, left, right, words, consistent=True)


def _ends(row: ParameterRow) -> tuple[float, float]:
    """Ends of the interval, the estimate itself where σ is not finite."""
    return row.interval() if math.isfinite(row.std) else (row.value, row.value)
