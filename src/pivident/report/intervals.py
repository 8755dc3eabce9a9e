"""Estimates with their ±2σ intervals as small drawings, in percent of their width.

Parameters differ by orders of magnitude and by unit, so each one gets a scale of its own.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from pivident.estimation.parameter_rows import ParameterRow, known, with_spread

#: Free space left and right of the drawing [% of its width].
_MARGIN = 6.0


@dataclass(frozen=True)
class Interval:
    """One estimate on the drawing's scale, 0 to 100.

    Attributes:
        method: index of the method, which is its colour.
        middle: estimate.
        left: estimate - 2σ.
        right: estimate + 2σ.
        robust_left: estimate - 2 robust σ.
        robust_right: estimate + 2 robust σ.
    """

    method: int
    middle: float
    left: float
    right: float
    robust_left: float
    robust_right: float


@dataclass(frozen=True)
class IntervalDrawing:
    """Intervals of one parameter.

    Attributes:
        intervals: one per method that estimates it.
        zero: place of zero, None where it lies outside.
        truth: place of the known value, None where it is not known.
        low: what stands at the left edge of the scale.
        high: what stands at the right edge.
        label: the drawing in words.
    """

    intervals: tuple[Interval, ...]
    zero: float | None
    truth: float | None
    low: str
    high: str
    label: str


def interval_drawing(
    rows: Sequence[ParameterRow | None],
    labels: Sequence[str],
    *,
    with_zero: bool,
) -> IntervalDrawing:
    """Place the intervals of one parameter on a common scale.

    Args:
        rows: estimates of one parameter, one per method, None where there is none.
        labels: names of the methods.
        with_zero: whether the scale reaches to zero.
    """
    present = [(k, row) for k, row in enumerate(rows) if row is not None]
    ends = [end for _, row in present for end in _ends(row)]
    truth = present[0][1].truth
    marks = ([0.0] if with_zero else []) + ([truth] if math.isfinite(truth) else [])
    low, high = min(ends + marks), max(ends + marks)
    extent = (high - low) or abs(high) or 1.0

    def place(x: float) -> float:
        return round(_MARGIN + (100.0 - 2.0 * _MARGIN) * (x - low) / extent, 2)

    words = "; ".join(f"{labels[k]} {_in_words(row)}" for k, row in present)
    true_value = f"; true value {known(truth)}" if math.isfinite(truth) else ""
    return IntervalDrawing(
        intervals=tuple(
            Interval(k, place(row.value), *(place(end) for end in _ends(row))) for k, row in present
        ),
        zero=place(0.0) if low <= 0.0 <= high else None,
        truth=place(truth) if math.isfinite(truth) else None,
        low=with_spread(low, extent / 10.0)[0],
        high=with_spread(high, extent / 10.0)[0],
        label=f"{present[0][1].name}: {words}{true_value}",
    )


def _ends(row: ParameterRow) -> tuple[float, float, float, float]:
    """Ends of ±2σ and of ±2 robust σ, the estimate itself where σ is not finite."""
    own, robust = (2.0 * s if math.isfinite(s) else 0.0 for s in (row.std, row.robust_std))
    return row.value - own, row.value + own, row.value - robust, row.value + robust


def _in_words(row: ParameterRow) -> str:
    value, spread = with_spread(row.value, 2.0 * row.std)
    return f"{value} ± {spread} {row.unit}"
