"""Gaps in the stamps of a log, and the stretches between them that can be used.

Over short gaps samples are interpolated on request. Nothing is interpolated over longer
ones: the motion in between is not known. What lies before and behind such a gap is still good, as a
recording of its own or as several.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from pivident.errors.recordings import Stretches

#: An interval longer than this many median ones lacks samples.
GAP = 1.5

#: Intervals up to the longer of these can be interpolated: so many median ones, and [s].
BRIDGED_PERIODS, BRIDGED_SECONDS = 3.5, 0.01

#: Stretches shorter than this share of the longest one are not worth a recording.
WORTHWHILE = 0.1


def bridged_interval(period: float) -> float:
    """Longest interval that is interpolated on request [s]; period [s]."""
    return max(BRIDGED_PERIODS * period, BRIDGED_SECONDS)


def stretches(t: np.ndarray) -> Stretches:
    """What gaps leave of a log of one clock, which is regular but for them; t (samples,) [s]."""
    intervals = np.diff(t)
    period = float(np.median(intervals))
    lacking = intervals[intervals > GAP * period]
    gaps = np.flatnonzero(intervals > bridged_interval(period))
    between = list(zip([t[0], *t[gaps + 1]], [*t[gaps], t[-1]], strict=True))
    return stretches_of(between, period, bool(len(lacking) > len(gaps)))


def stretches_of(
    between: Sequence[tuple[float, float]], period: float, resample: bool
) -> Stretches:
    """What gaps leave of a log; between [s], period [s]."""
    lengths = [float(stop - start) for start, stop in between]
    whole = float(between[-1][1] - between[0][0])
    worth = [length >= WORTHWHILE * max(lengths) for length in lengths]
    parts = [
        _inward(start, stop, period) for (start, stop), w in zip(between, worth, strict=True) if w
    ]
    short = sum(length for length, w in zip(lengths, worth, strict=True) if not w)
    lost = whole - sum(lengths) if len(between) > 1 else 0.0
    return Stretches(tuple(parts), whole, lost, short, resample)


def _inward(start: float, stop: float, period: float) -> tuple[float, float]:
    """Decimals as coarse as samples are, rounded so that no gap comes in."""
    digits = max(3, math.ceil(-math.log10(period)))
    unit = 10.0**-digits
    low = round(math.ceil(start / unit - 1e-6) * unit, digits)
    high = round(math.floor(stop / unit + 1e-6) * unit, digits)
    low = low if low >= start else round(low + unit, digits)
    high = high if high <= stop else round(high - unit, digits)
    return (low, high) if low < high else (float(start), float(stop))


def runs_of(mask: np.ndarray) -> np.ndarray:
    """First and last-plus-one index of each run of true values, shape (runs, 2)."""
    edges = np.diff(mask.astype(np.int8), prepend=0, append=0)
    return np.column_stack([np.flatnonzero(edges == 1), np.flatnonzero(edges == -1)])
