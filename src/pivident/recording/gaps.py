"""Gaps in the stamps of a log, and the stretches between them that can be used.

Over short gaps samples are interpolated if that is asked for. Nothing is interpolated over longer
ones: the motion in between is not known. What lies before and behind such a gap is still good, as a
recording of its own or as several.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

#: An interval longer than this many median ones lacks samples.
GAP = 1.5

#: Intervals up to the longer of these can be interpolated: so many median ones, and [s].
BRIDGED_PERIODS, BRIDGED_SECONDS = 3.5, 0.01

#: Stretches shorter than this share of the longest one are not worth a recording.
WORTHWHILE = 0.1

#: Most stretches that are listed one by one.
LISTED = 6


@dataclass(frozen=True)
class Stretches:
    """What gaps leave of a log.

    Attributes:
        parts: first and last time of each stretch that is worth a recording, in order of time [s];
            written as decimals, they lie within the stretch.
        seconds: length of the whole log, gaps included [s].
        lost: time that is inside of the gaps that nothing bridges [s].
        short: time of the stretches that are not worth a recording [s].
        resample: whether shorter gaps remain inside of the parts, to be interpolated.
    """

    parts: tuple[tuple[float, float], ...]
    seconds: float
    lost: float
    short: float
    resample: bool

    @property
    def longest(self) -> tuple[float, float]:
        """First and last time of the longest stretch [s]."""
        return max(self.parts, key=lambda part: part[1] - part[0])

    def advice(self) -> str:
        """What the gaps cost, and what to write into the experiment file, as a half sentence."""
        fill = "set resample = true" if self.resample else ""
        if not self.lost:
            return f"{fill}, which fills gaps as short as these" if fill else ""
        length = self.longest[1] - self.longest[0]
        kept = f"{length:.4g} s of {self.seconds:.4g} s"
        text = f"write {written(self.longest)} to keep the longest stretch between gaps, {kept}"
        if len(self.parts) > 1:
            first = sorted(self.parts, key=lambda part: part[0] - part[1])[:LISTED]
            listed = ", ".join(written(part) for part in sorted(first))
            number = "both" if len(self.parts) == 2 else f"the {len(first)} longest"
            number = "each" if 2 < len(self.parts) <= LISTED else number
            text += f", or one table [[recording]] for {number}: {listed}"
        costs = [f"{self.lost:.3g} s are lost inside of the gaps"]
        if self.short:
            costs.append(f"{self.short:.3g} s in stretches too short for a motion")
        more = f"; {fill} too, which fills the shorter gaps" if fill else ""
        return f"{text} ({' and '.join(costs)}){more}"


def written(part: tuple[float, float]) -> str:
    """A part as the experiment file has it."""
    return f"part = [{part[0]!r}, {part[1]!r}]"


def bridged_interval(period: float) -> float:
    """Longest interval that is interpolated where that is asked for [s].

    Args:
        period: the usual interval [s].
    """
    return max(BRIDGED_PERIODS * period, BRIDGED_SECONDS)


def stretches(t: np.ndarray) -> Stretches:
    """What gaps leave of a log of one clock, which is regular but for them.

    Args:
        t: stamps that increase, shape (samples,) [s].
    """
    intervals = np.diff(t)
    period = float(np.median(intervals))
    lacking = intervals[intervals > GAP * period]
    gaps = np.flatnonzero(intervals > bridged_interval(period))
    between = list(zip([t[0], *t[gaps + 1]], [*t[gaps], t[-1]], strict=True))
    return stretches_of(between, period, bool(len(lacking) > len(gaps)))


def stretches_of(
    between: Sequence[tuple[float, float]], period: float, resample: bool
) -> Stretches:
    """What gaps leave of a log.

    Args:
        between: first and last instant of every stretch, in order of time [s].
        period: between samples [s].
        resample: whether shorter gaps remain inside, or channels have clocks of their own.
    """
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
