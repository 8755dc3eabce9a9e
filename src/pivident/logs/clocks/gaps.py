"""Gaps in the stamps and samples of a log, and the stretches between them that can be used.

Over short gaps samples are interpolated on request. Nothing is interpolated over longer
ones: the motion in between is not known. What lies before and behind such a gap is still good, as a
recording of its own or as several.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from pivident.errors.recordings import Stretches

#: An interval longer than this many median ones lacks samples.
GAP = 1.5

#: Intervals up to the longer of these can be interpolated: so many median ones, and [s].
BRIDGED_PERIODS, BRIDGED_SECONDS = 3.5, 0.01

#: Stretches shorter than this share of the longest one are not worth a recording.
WORTHWHILE = 0.1

#: A joint moves if it is at least this fast, relative to its range over the whole duration.
SLOWEST_MOTION = 0.1


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


def moves(q: np.ndarray, start: int, stop: int) -> bool:
    """Whether the joint travels during some samples, compared with its whole motion."""
    return bool(np.ptp(q[start:stop]) / (stop - start) > SLOWEST_MOTION * np.ptp(q) / len(q))


def long_stretches(usable: np.ndarray) -> np.ndarray:
    """Samples of stretches without usable ones that are too long to be filled in well."""
    long = np.zeros(len(usable), bool)
    for start, stop in runs_of(~usable):
        long[start:stop] = stop - start > BRIDGED_PERIODS
    return long


def clear_of_unusable(usable: np.ndarray, before: int, behind: int) -> np.ndarray:
    """Samples with none but usable ones from so many before to so many behind, (samples,)."""
    if usable.all() or not before + behind:
        return usable
    around = np.pad(usable, (before, behind), constant_values=True)
    return np.asarray(sliding_window_view(around, before + behind + 1).all(axis=1))


def mostly_usable(usable: np.ndarray, reach: int) -> np.ndarray:
    """Samples whose neighbours within reach are mostly usable, the others well filled, (samples,).

    For what averages over the neighbours.
    """
    around = sliding_window_view(np.pad(usable, reach, constant_values=True), 2 * reach + 1)
    return clear_of_unusable(~long_stretches(usable), reach, reach) & (around.mean(axis=1) > 0.5)
