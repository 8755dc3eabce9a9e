"""Noise-to-variance ratio of positions with visible counts.

The error of a rounded position is like white noise of variance Δ²/12 only while counts change
quickly. At standstill it is constant, so that the record has no noise there at all, and in slow
motion it is a staircase. Maximum likelihood over the whole record then fits the steps as motion:
the more a joint stands still, the wider the smoother becomes (340 Hz instead of 20 Hz on a
simulated arm with 3600 counts per revolution and a third of standstill), noise dominates the
accelerations, and an estimator that uses them may not converge.

The ratio is therefore estimated where counts change quickly, and used for the whole record; it is
raised where the smoothed record would then be further from the positions than rounding explains,
because a reversal, whose counts change slowly, needs more bandwidth. Where counts never change
quickly the ratio begins with one that hardly lets anything through, and is raised likewise.
"""

from __future__ import annotations

import math

import numpy as np

from pivident.signals.random_walk_likelihood import MAX_NVR, MIN_NVR, diffuse_fit, estimate_nvr
from pivident.signals.random_walk_model import f50_from_nvr, nvr_from_f50

#: Fraction of samples that repeat the one before, above which counts are visible.
REPEATED = 0.5

#: Share of the steps that are whole counts, to a part of a count; those of more counts are rounded.
ON_COUNTS, OFF_COUNT, MANY = 0.9, 0.1, 100

#: Differences below this share of the range are none.
ROUNDING = 1e-12

#: Counts change quickly as long as none lasts longer than this [s] …
MAX_PAUSE = 0.005

#: … or this many samples in slow logs.
MIN_SAMPLES = 3

#: Shortest stretch for a ratio [s], several periods of what a smoother keeps, and in samples.
MIN_STRETCH, MIN_STRETCH_SAMPLES = 0.1, 100

#: Half-power frequency with which the ratio of a slow joint begins [Hz].
SLOWEST = 1.0


def has_visible_counts(y: np.ndarray) -> bool:
    """Whether most samples of a channel repeat the one before, and all others are counts away.

    New samples between counts, at the instants of another clock, have a standstill as well, but no
    count.
    """
    steps = np.abs(np.diff(y))
    moves = steps[steps > ROUNDING * np.ptp(y)]
    if not moves.size or 1.0 - moves.size / steps.size <= REPEATED:
        return False
    counts = moves[moves < MANY * moves.min()] / moves.min()
    return bool(np.mean(np.abs(counts - np.round(counts)) < OFF_COUNT) > ON_COUNTS)


def counting_stretches(y: np.ndarray, rate: float) -> list[slice]:
    """Stretches in which counts change quickly."""
    changes = np.flatnonzero(np.diff(y)) + 1
    if changes.size == 0:
        return []
    breaks = np.flatnonzero(np.diff(changes) > max(MIN_SAMPLES, round(MAX_PAUSE * rate)))
    first = changes[np.concatenate([[0], breaks + 1])]
    last = changes[np.concatenate([breaks, [changes.size - 1]])]
    shortest = max(MIN_STRETCH_SAMPLES, math.ceil(MIN_STRETCH * rate))
    return [slice(int(a), int(b)) for a, b in zip(first, last, strict=True) if b - a >= shortest]


def nvr_of_counts(
    y: np.ndarray, rate: float, order: int = 3, f50_max: float | None = None
) -> float | None:
    """Noise-to-variance ratio of a channel with visible counts.

    The median of the ratios of largest likelihood of the stretches, weighted by their length, is
    doubled as long as the smoothed record is further from the positions than Δ/√12 (rms, without
    standstill). None where counts are not visible or all last long: then the whole record decides.
    """
    moving = _moving(y, rate)
    if not has_visible_counts(y) or not moving.any():
        return None
    nvr = _nvr_of_stretches(y, rate, order, f50_max)
    steps = np.abs(np.diff(y))
    rounding = float(steps[steps > 0].min()) / math.sqrt(12.0)
    centred = np.ascontiguousarray(y - y.mean())
    limit = MAX_NVR if f50_max is None else nvr_from_f50(f50_max, order, rate)
    while nvr < limit:
        error = (centred - diffuse_fit(centred, nvr, order).level)[moving]
        if np.sqrt(np.mean(error**2)) <= rounding:
            break
        nvr = min(2.0 * nvr, limit)
    return nvr


def _nvr_of_stretches(y: np.ndarray, rate: float, order: int, f50_max: float | None) -> float:
    """Median of the ratios of stretches in which counts change quickly.

    A smoother that is faster than the counts of its stretch follows their steps; such a ratio says
    nothing of the motion. Where none is left, that of ``SLOWEST``.
    """
    ratios, sizes = [], []
    for part in counting_stretches(y, rate):
        own = np.ascontiguousarray(y[part] - y[part].mean())
        counted = np.count_nonzero(np.diff(own)) * rate / own.size  # counts per second
        nvr = estimate_nvr(own, rate, order, f50_max).nvr
        if f50_from_nvr(nvr, order, rate) < 0.5 * counted:
            ratios.append(nvr)
            sizes.append(own.size)
    if not ratios:
        slowest = SLOWEST if f50_max is None else min(SLOWEST, f50_max)
        return max(nvr_from_f50(slowest, order, rate), MIN_NVR[order])
    ascending = np.argsort(ratios)
    reached = np.cumsum(np.array(sizes)[ascending])
    return float(ratios[ascending[np.searchsorted(reached, reached[-1] / 2)]])


def _moving(y: np.ndarray, rate: float) -> np.ndarray:
    """False where a count lasts longer than the shortest stretch, shape (samples,)."""
    edges = np.concatenate([[0], np.flatnonzero(np.diff(y)) + 1, [y.size]])
    lasting = np.diff(edges)
    return np.repeat(lasting <= max(MIN_STRETCH_SAMPLES, MIN_STRETCH * rate), lasting)
