"""The rate that a clock was set to: a usual one that its stamps agree with, or none.

Rows that were lost make the mean rate of irregular stamps too low: 983 Hz where a logger of 1 kHz
dropped every sixtieth row, 999 Hz where it dropped one in a thousand. Whether the stamps lie on a
grid of period 1/f says the mean of their phasors,

    R(f) = |mean exp(2πi f t_k)|,

which lost rows do not change and independent jitter of standard deviation σ lowers to
exp(-2π² f² σ²). Without a grid the mean rate has an interval, from its scatter over stretches of
the log, and a usual rate inside that is taken.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pivident.data.logs.timestamps import bridged_interval, round_rate, usual_interval

#: Rates to which loggers, buses and drives are set [Hz].
USUAL_RATES = (
    10.0, 20.0, 25.0, 30.0, 40.0, 50.0, 60.0, 80.0, 100.0, 120.0, 125.0, 200.0, 240.0, 250.0,
    400.0, 500.0, 800.0, 1000.0, 2000.0, 4000.0, 5000.0, 8000.0, 10000.0, 16000.0, 20000.0,
)  # fmt: skip
#: Relative error of the clock of a computer that nobody has set, a quartz's.
QUARTZ = 2e-4
#: Coherence of stamps with a grid: it has a quarter of a period of jitter.
COHERENT = 0.25
#: Share of the rows of a grid that may be lost.
MAX_LOST = 0.2
#: Stamps from which a grid is found, and stretches of which each has a rate of its own.
MAX_STAMPS, STRETCHES = 20_000, 20
#: Fewest intervals of a stretch.
MIN_INTERVALS = 10


@dataclass(frozen=True)
class ClockRate:
    """Rate of irregular stamps.

    Attributes:
        mean: rows per second between the gaps [Hz].
        error: half the 95 % interval of the mean, the error of a quartz included [Hz].
        nominal: the usual rate that the stamps agree with [Hz], or None.
        on_grid: whether the stamps lie on the grid of the nominal rate but for their jitter.
        lost: rows that the grid of the nominal rate has and the log lacks, 0 without a grid.
    """

    mean: float
    error: float
    nominal: float | None = None
    on_grid: bool = False
    lost: int = 0

    @property
    def rate(self) -> float:
        """The nominal rate, else that of the rows [Hz]."""
        return self.mean if self.nominal is None else self.nominal

    def __str__(self) -> str:
        """What the stamps say, as a part of a sentence."""
        found = f"rows come at {self.mean:.5g} ± {self.error:.2g} Hz"
        if self.nominal is None:
            return f"{found}, which is no usual rate"
        if not self.on_grid:
            return f"{found}, which allows the usual {self.nominal:g} Hz"
        lost = f", of which {self.lost} are lost" if self.lost else ""
        return f"{found}, and their stamps lie on the grid of {self.nominal:g} Hz{lost}"


def clock_rate(t: np.ndarray, even: bool = False) -> ClockRate:
    """Rate of a clock that jitters, and the usual rate that it was set to, where there is one.

    Args:
        t: increasing stamps, shape (samples,) [s].
        even: whether the samples are known to be equally spaced, so that none is lost.

    Returns:
        Mean rate with its interval, and the nominal rate.
    """
    intervals = np.diff(t)
    whole = intervals[intervals <= bridged_interval(usual_interval(intervals))]
    mean = 1.0 / float(np.mean(whole))
    error = mean * max(2.0 * _relative_error(whole), QUARTZ)
    grid = None if even else _grid(t, mean)
    if grid is not None:
        lost = round(float(whole.sum()) * grid) - len(whole)
        return ClockRate(round_rate(mean), error, grid, True, max(0, lost))
    return ClockRate(round_rate(mean), error, usual_rate(mean - error, mean + error))


def usual_rate(low: float, high: float) -> float | None:
    """The only usual rate in an interval, None where there is none or several [Hz]."""
    inside = [rate for rate in USUAL_RATES if low <= rate <= high]
    return inside[0] if len(inside) == 1 else None


def usual_near(rate: float) -> float | None:
    """The usual rate that a rate is but for the error of a quartz, or None [Hz]."""
    return usual_rate(rate * (1.0 - QUARTZ), rate * (1.0 + QUARTZ))


def _relative_error(intervals: np.ndarray) -> float:
    """Standard error of the mean interval, relative: scatter over stretches of the log.

    Jitter of single stamps cancels within a stretch, that of sleeping loops adds up.
    """
    count = min(STRETCHES, len(intervals) // MIN_INTERVALS)
    if count < 2:
        return 0.0
    means = np.array([np.mean(part) for part in np.array_split(intervals, count)])
    return float(np.std(means, ddof=1) / np.sqrt(count) / np.mean(intervals))


def _grid(t: np.ndarray, mean: float) -> float | None:
    """The lowest usual rate on whose grid the stamps lie, at most `MAX_LOST` of it empty [Hz]."""
    t = t[:MAX_STAMPS] - t[0]
    for rate in USUAL_RATES:
        if not (1.0 - MAX_LOST) * rate <= mean <= (1.0 + QUARTZ) * rate:
            continue
        step = 0.25 / float(t[-1])
        reach = max(1, int(np.ceil(QUARTZ * rate / step)))
        tried = rate + step * np.arange(-reach, reach + 1)
        if max(abs(np.mean(np.exp(2j * np.pi * f * t))) for f in tried) > COHERENT:
            return rate
    return None
