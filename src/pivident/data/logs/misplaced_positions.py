"""Positions out of place: encoders that freeze, excursions from the motion, places to cut a log.

A step of a joint is out of place where it is many times as large as the steps around it: a motion
gains speed over several samples. The steps that lead out of the motion and back again enclose wrong
samples; a step without a way back is a place at which the log has to be cut.
"""

from __future__ import annotations

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from pivident.data.logs.timestamps import GAP, runs_of

#: Fewest samples of a log that are compared.
MIN_ROWS = 50

#: A step is out of place if it is so many times as large as those around it, and as nearly all.
ABOVE_NEIGHBOURS, ABOVE_USUAL = 8.0, 3.0

#: … and may be if it is so many times as large as those around it.
REMARKABLE = 3.0

#: Steps on either side that are compared, of which so many may be out of place themselves.
AROUND, OTHERS_OUT_OF_PLACE = 3, 2

#: Longest excursion out of the motion and back again [samples].
MAX_EXCURSION = 100

#: Shortest standstill of one encoder that counts [samples].
MIN_FROZEN = 4


def cuts(q: np.ndarray, t: np.ndarray | None = None) -> np.ndarray:
    """Samples before which the positions jump and do not come back, shape (cuts,).

    Args:
        q: positions without bad samples, NaN in their place, shape (samples, joints).
        t: their stamps, shape (samples,), where they are known.
    """
    if len(q) < MIN_ROWS:
        return np.empty(0, int)
    return np.unique(np.concatenate([np.array(excursions(x, t)[1], int) for x in q.T])) + 1


def frozen_positions(x: np.ndarray) -> np.ndarray:
    """Samples of a position that stay while the joint moves on, which one step then makes good."""
    step = np.abs(np.diff(x))
    rows = []
    for start, stop in runs_of(step == 0.0).tolist():
        # the samples start + 1 … stop repeat the one at start; the step behind them is stop
        if stop - start < MIN_FROZEN or stop >= len(step):
            continue
        around = np.r_[step[max(0, start - 5) : start], step[stop + 1 : stop + 6]]
        around = around[np.isfinite(around)]
        if around.size < 6:
            continue
        usual = float(np.median(around))
        if usual == 0.0:  # positions that come more slowly than the samples
            continue
        if step[stop] > 0.5 * usual * (stop - start) and step[stop] > 2.0 * around.max():
            rows.append(np.arange(start + 1, stop + 1))
    return np.concatenate(rows) if rows else np.empty(0, int)


def excursions(x: np.ndarray, t: np.ndarray | None) -> tuple[list[tuple[int, int]], list[int]]:
    """Samples (start, stop) out of place, and steps that nothing takes back.

    Of the steps out and back again one is out of place beyond doubt; the other, which the motion
    may have shortened, has to be remarkable. A step over a gap in the stamps is none, nor one of a
    whole turn, which is an angle that wraps.
    """
    step = np.abs(np.diff(x))
    counted = step[np.isfinite(step) & (step > 0)]
    if counted.size < MIN_ROWS // 2:
        return [], []
    usual, smallest = float(np.quantile(counted, 0.9)), float(counted.min())
    steps, clear = [], set()
    finite = np.nan_to_num(step)
    large = np.flatnonzero(finite > max(usual, 2.0 * smallest))
    around = np.delete(
        sliding_window_view(np.pad(finite, AROUND), 2 * AROUND + 1)[large], AROUND, 1
    )
    highest = np.sort(around, axis=1)[:, -1 - OTHERS_OUT_OF_PLACE]
    above = finite[large] / np.maximum(highest, 1e-300)
    for k, ratio in zip(large[above > REMARKABLE], above[above > REMARKABLE], strict=True):
        if not any(abs(step[k] / turn - 1.0) < 0.02 for turn in (2.0 * np.pi, 360.0)):
            steps.append(int(k))
            if ratio > ABOVE_NEIGHBOURS and step[k] > max(ABOVE_USUAL * usual, 5.0 * smallest):
                clear.add(int(k))
    if t is not None and len(t) == len(x) and clear:
        intervals = np.diff(t)
        steps = [k for k in steps if intervals[k] <= GAP * np.median(intervals)]
    out, single, k = [], [], 0
    while clear and k < len(steps):
        first = steps[k]
        back = next((m for m in steps[k + 1 :] if _comes_back(x, step, first, m)), None)
        if back is not None:
            if clear & {first, back}:
                out.append((first + 1, back + 1))
            k = steps.index(back)
        elif first in clear:
            single.append(first)
        k += 1
    return out, single


def _comes_back(x: np.ndarray, step: np.ndarray, first: int, last: int) -> bool:
    """Whether the step at ``last`` leads back to where the motion would be."""
    length = last + 1 - first
    if length > MAX_EXCURSION:
        return False
    around = np.r_[np.diff(x[max(0, first - 5) : first + 1]), np.diff(x[last + 1 : last + 7])]
    around = around[np.isfinite(around)]
    usual = float(np.median(np.abs(around))) if around.size else 0.0
    expected = float(np.median(around)) * length if around.size else 0.0
    reach = max((1.0 + 0.5 * length) * usual, 0.2 * max(step[first], step[last]))
    return bool(abs(x[last + 1] - x[first] - expected) <= reach)
