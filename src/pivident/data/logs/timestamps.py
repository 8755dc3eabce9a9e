"""From time stamps to a sampling rate, a uniform grid, and the stretches between gaps.

Gaps in the stamps and samples of a log, and the stretches between them that can be used.

Over short gaps samples are interpolated on request. Nothing is interpolated over longer
ones: the motion in between is not known. What lies before and behind such a gap is still good, as a
recording of its own or as several.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from numbers import Real

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from pivident.data.logs.units import TIME
from pivident.foundation.errors import (
    IrregularSampling,
    MissingSamples,
    RecordingError,
    RecordingTooShort,
)
from pivident.foundation.errors.recordings import Stretches
from pivident.signals.cubic_spline import cubic_spline

#: Fewest samples that can be differentiated twice and still leave something to fit.
MIN_SAMPLES = 16
#: Largest deviation of one interval from the median interval, relative.
JITTER_TOLERANCE = 0.1
#: Largest disagreement between a given rate and the one of the stamps, relative.
RATE_TOLERANCE = 0.01
#: Rates below this are no robot's log but stamps in another unit [Hz].
LOWEST_RATE = 5.0
#: Rates above this are no robot's log either [Hz].
HIGHEST_RATE = 1e6
#: Rates that the log of a robot may well have [Hz].
LIKELY_RATES = (LOWEST_RATE, 20e3)
#: Ratio of `stamp_error` from which on samples are equally spaced, and their stamps are not.
EVEN = 2.0
#: Share of stamps that may repeat the one before as rows that were logged twice.
TOLERATED_REPEATS = 0.02
#: Samples that are closer than this share of the median interval nearly coincide.
CLOSE = 0.1
#: Most samples of a uniform grid for each sample that was logged.
MAX_NEW_SAMPLES = 100
#: An interval longer than this many median ones lacks samples.
GAP = 1.5
#: Intervals up to the longer of these can be interpolated: so many median ones, and [s].
BRIDGED_PERIODS, BRIDGED_SECONDS = 3.5, 0.01
#: Stretches shorter than this share of the longest one are not worth a recording.
WORTHWHILE = 0.1
#: A joint moves if it is at least this fast, relative to its range over the whole duration.
SLOWEST_MOTION = 0.1


def check_length(samples: int) -> None:
    """Refuse a recording of fewer than `MIN_SAMPLES` samples."""
    if samples < MIN_SAMPLES:
        raise RecordingTooShort(samples, MIN_SAMPLES)


def check_positive(name: str, value: float) -> None:
    """Refuse a rate that is not a positive, finite number, or above any of a robot."""
    if not isinstance(value, Real) or not (np.isfinite(value) and value > 0):
        raise RecordingError(f"{name} is {value!r} Hz", advice="a positive number is needed")
    if value > HIGHEST_RATE:
        raise RecordingError(
            f"{name} is {value:g} Hz, unlike any robot's log", advice="it is given in Hz"
        )


def likely_time_units(interval: float) -> list[str]:
    """Units in which stamps at such intervals have the rate of a robot's log, seconds first."""
    low, high = LIKELY_RATES
    return [unit for unit, s in TIME.items() if low <= 1.0 / (interval * s) <= high]


def check_seconds(t: np.ndarray) -> None:
    """Refuse stamps whose unit nobody gave and that are hardly seconds; t (samples,)."""
    interval = float(np.median(np.diff(t))) if len(t) > 1 else 0.0
    if not interval > 1.0 / LOWEST_RATE:
        return
    unit = next(iter(likely_time_units(interval)), "ms")
    raise RecordingError(
        f"the time stamps advance by {interval:g} s, a rate of {1.0 / interval:.4g} Hz",
        advice=f'are they in {unit}? set units = {{t = "{unit}"}}, or t = "s" if they are seconds',
    )


def check_increasing(t: np.ndarray) -> None:
    """Refuse stamps that are not finite, repeat themselves or go backward; t (samples,) [s]."""
    check_length(len(t))
    bad = np.flatnonzero(~np.isfinite(t))
    if bad.size:
        raise RecordingError(
            f"time stamp of sample {bad[0]} is {t[bad[0]]}",
            advice="remove that row or give the rate",
        )
    intervals = np.diff(t)
    wrong = np.flatnonzero(intervals <= 0)
    if wrong.size:
        k = int(wrong[0])
        raise _irregular("duplicate" if intervals[k] == 0 else "backward", k + 1, t, intervals)


def without_repeats(
    t: np.ndarray, columns: Iterable[np.ndarray] = ()
) -> tuple[np.ndarray, np.ndarray]:
    """Stamps of which a few repeat the one before, and the rows to keep, shape (samples,).

    Where the interval behind such a stamp is two periods and most of the ``columns`` are nearer to
    the middle of the rows on both sides than to the row before, only the stamp is wrong, and lies
    midway. Elsewhere the row was logged twice. Longer runs are messages that arrived together, and
    many repeats a clock that is coarse: they stay as they are.
    """
    keep, steps = np.ones(len(t), bool), np.diff(t)
    again = np.flatnonzero(steps == 0.0) + 1
    if not 0 < again.size <= TOLERATED_REPEATS * len(t) or (np.diff(again) == 1).any():
        return t, keep
    if not (steps >= 0.0).all():  # NaN, too
        return t, keep
    votes, inside = np.zeros(again.size), np.minimum(again + 1, len(t) - 1)
    for x in columns:
        before, here, behind = (x[k].reshape(again.size, -1) for k in (again - 1, again, inside))
        moved = np.abs(here - 0.5 * (before + behind)) < np.abs(here - before)
        votes += np.where(before != behind, np.where(moved, 1, -1), 0).sum(axis=1)
    t, period = t.copy(), usual_interval(steps[steps > 0.0])
    for k, vote in zip(again.tolist(), votes, strict=True):
        interval = (t[k + 1] - t[k]) / period if k + 1 < len(t) else np.inf
        if vote > 0 and abs(interval - 2.0) < 2.0 * JITTER_TOLERANCE:
            t[k] += 0.5 * (t[k + 1] - t[k])
        else:
            keep[k] = False
    return t, keep


def usual_interval(intervals: np.ndarray) -> float:
    """The median as an interval that occurs; of 10 and 12 ms in turn 11 ms would be none [s]."""
    return float(np.quantile(intervals, 0.5, method="lower"))


def rate_of(t: np.ndarray) -> float:
    """Sampling rate of regular time stamps: intervals over elapsed time [Hz]; t (samples,) [s]."""
    check_increasing(t)
    intervals = np.diff(t)
    deviation = np.abs(intervals / usual_interval(intervals) - 1.0)
    if deviation.max() > JITTER_TOLERANCE:
        _check_complete(t, intervals, deviation)
        raise _irregular("jitter", int(np.argmax(deviation > JITTER_TOLERANCE)) + 1, t, intervals)
    return round_rate((len(t) - 1) / (t[-1] - t[0]))


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


def mean_rate(t: np.ndarray) -> float:
    """Samples per second of recorded time, gaps left out; t (samples,) [s].

    The most frequent interval is no rate: of stamps that are 10 and 12 ms apart in turn it is one
    of the two. On a regular clock longer intervals are lost samples, on an irregular one they are
    its own.
    """
    intervals = np.diff(t)
    period = usual_interval(intervals)
    whole = intervals[intervals <= bridged_interval(period)]
    regular = whole[whole <= GAP * period]
    if np.abs(regular / period - 1.0).max() > JITTER_TOLERANCE:
        regular = whole
    return round_rate(1.0 / float(np.mean(regular)))


def stamp_error(q: np.ndarray, t: np.ndarray) -> float:
    """How much worse motion fits the stamps than equal steps, median over the moving joints.

    Each sample is interpolated by a cubic from its four neighbours, at the stamps and at equal
    steps. A ratio of the two errors far below one says that the stamps are when the samples were
    taken; far above one, that the samples were taken at equal intervals and stamped late or early.

    Args:
        q: positions, shape (samples, joints) [rad or m].
        t: increasing stamps, shape (samples,) [s].

    Returns:
        Ratio of the median errors; NaN where nothing moves, or of a few samples.
    """
    if len(t) <= MIN_SAMPLES:
        return float("nan")
    length = np.diff(t) / np.median(np.diff(t))
    even = _interpolation_error(q, np.arange(len(t), dtype=float))
    stamped = _interpolation_error(q, np.r_[0.0, np.cumsum(length)])
    speed = np.abs(q[4:] - q[:-4])
    moving = speed > 0.2 * np.quantile(speed, 0.995, axis=0)
    ratios = [
        np.median(stamped[rows, j]) / max(np.median(even[rows, j]), 1e-300)
        for j, rows in enumerate(moving.T)
        if rows.sum() > MIN_SAMPLES
    ]
    return float(np.median(ratios)) if ratios else float("nan")


def _interpolation_error(q: np.ndarray, x: np.ndarray) -> np.ndarray:
    """|q_k - cubic through its four neighbours| at x_k, shape (samples - 4, joints)."""
    last = len(x) - 4
    nodes = [x[i : i + last] for i in (0, 1, 3, 4)]
    here, predicted = x[2 : 2 + last], np.zeros((last, q.shape[1]))
    for i, node in zip((0, 1, 3, 4), nodes, strict=True):
        weight = np.ones(last)
        for other in nodes:
            if other is not node:
                weight *= (here - other) / (node - other)
        predicted += weight[:, None] * q[i : i + last]
    return np.abs(q[2 : 2 + last] - predicted)


def _check_complete(t: np.ndarray, intervals: np.ndarray, deviation: np.ndarray) -> None:
    """Distinguish missing samples from an irregular clock."""
    period = usual_interval(intervals)
    gaps = lacking(intervals, period)
    if gaps.size and gaps.size == np.sum(deviation > JITTER_TOLERANCE):
        k = int(gaps[np.argmax(intervals[gaps])])
        missing = int(np.sum(np.round(intervals[gaps] / period) - 1))
        where = (k, float(t[k]), float(intervals[k]))
        raise MissingSamples(missing, gaps.size, *where, stretches(t))


def lacking(intervals: np.ndarray, period: float) -> np.ndarray:
    """Numbers of the intervals that are multiples of the period up to the jitter, or pauses."""
    periods = intervals / period
    whole = np.abs(periods - np.round(periods)) <= 2.0 * JITTER_TOLERANCE
    # A logger that paused begins anew at any time.
    return np.flatnonzero((periods > GAP) & (whole | (intervals > bridged_interval(period))))


def round_rate(rate: float) -> float:
    """The whole number of hertz within a clock's accuracy (1e-5), else the rate itself."""
    return float(round(rate)) if abs(rate - round(rate)) < 1e-5 * rate else float(rate)


def check_declared(rate: float) -> None:
    """Refuse a declared rate that no robot's log has."""
    check_positive("rate", rate)
    if rate < LOWEST_RATE:
        raise RecordingError(
            f"the rate is {rate:g} Hz, unlike any robot's log",
            advice="it may be a period in seconds, or a rate in kHz: rate is in Hz",
        )


def check_rate(rate: float, t: np.ndarray) -> None:
    """Refuse a given rate that contradicts the stamps, which need not be regular."""
    check_positive("rate", rate)
    check_length(len(t))
    elapsed = float(t[-1] - t[0])
    stamped = (len(t) - 1) / elapsed if elapsed > 0 else float("nan")
    if not abs(rate / stamped - 1.0) <= RATE_TOLERANCE:
        raise RecordingError(
            f"the rate was given as {rate:g} Hz, but the time stamps advance at {stamped:g} Hz",
            advice="check the unit of the time column, or leave one of the two out",
        )


def uniform_grid(
    t: np.ndarray, rate: float | None = None, span: tuple[float, float] | None = None
) -> tuple[np.ndarray, float]:
    """Times t₀ + k/rate over a stretch of time [s], and the rate [Hz]."""
    check_increasing(t)
    rate = mean_rate(t) if rate is None else float(rate)
    check_positive("rate to resample to", rate)
    rate = round_rate(rate)
    start, stop = (t[0], t[-1]) if span is None else span
    # Half a micro-sample of slack: the last stamp belongs to the grid although it is rounded.
    periods = float(np.floor((stop - start) * rate + 5e-7))
    if not periods < MAX_NEW_SAMPLES * len(t):
        raise RecordingError(
            f"{rate:g} Hz from {start:g} to {stop:g} s makes {periods:.3g} samples of {len(t)}, "
            f"more than {MAX_NEW_SAMPLES} for each",
            advice="check the rate, the unit of the time column, and gaps in it",
        ).about("rate")
    return np.minimum(start + np.arange(int(periods) + 1) / rate, stop), rate


def resample_smooth(t: np.ndarray, values: np.ndarray, grid: np.ndarray) -> np.ndarray:
    """Cubic spline through a channel; of samples that nearly coincide only the first one counts."""
    intervals = np.diff(t)
    apart = np.r_[True, intervals >= CLOSE * np.median(intervals)]
    if not apart.all():  # through two such samples the spline would be steep
        t, values = t[apart], values[apart]
    return cubic_spline(t, values)(grid)


def resample_linear(t: np.ndarray, values: np.ndarray, grid: np.ndarray) -> np.ndarray:
    """Straight lines between the samples."""
    return np.column_stack([np.interp(grid, t, column) for column in values.T])


def resample_held(t: np.ndarray, values: np.ndarray, grid: np.ndarray) -> np.ndarray:
    """The latest sample at each time, for what a controller holds (known inputs)."""
    return values[np.searchsorted(t, grid, side="right") - 1]


def _irregular(kind: str, sample: int, t: np.ndarray, intervals: np.ndarray) -> IrregularSampling:
    """The error that points at one stamp."""
    interval = float(intervals[sample - 1])
    expected = float(np.median(intervals)) or float(np.mean(intervals))
    return IrregularSampling(kind, sample, float(t[sample]), interval, expected)
