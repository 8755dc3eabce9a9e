"""Torques that keep a value for a while though their joint moves: a logger that lost its source.

No threshold in units can tell this from a coarse channel, whose value stays as well. The channel
itself can: where it is fine enough to change in half of the samples of every other stretch, it does
not keep one value through a whole one by chance. A logged speed may: axes move evenly.
"""

from __future__ import annotations

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from pivident.logs.clocks.gaps import moves, runs_of

#: Share of the samples below which one end of a record is filled up.
END = 0.01

#: Shortest stretch [samples] that is asked about, less does no harm, and fewest others to compare
#: with.
SHORTEST, FEWEST = 20, 5

#: It is compared with stretches of its own length, but no longer than the record over this.
COMPARED = 20

#: Share of the samples of each other stretch at which the value changes.
USUAL_CHANGES = 0.5


def frozen_samples(x: np.ndarray, q: np.ndarray) -> np.ndarray:
    """Samples at which a torque keeps its value as it never does elsewhere.

    Args:
        x: torque of a joint, shape (samples,).
        q: position of the joint, shape (samples,).

    Returns:
        Truth values, shape (samples,).
    """
    frozen = np.zeros(x.size, bool)
    same = np.diff(x) == 0.0
    kept = [
        (first, last + 1)
        for first, last in runs_of(same).tolist()
        if last + 1 - first >= _shortest(first, last + 1, x.size) and moves(q, first, last + 1)
    ]
    longest = max((stop - start for start, stop in kept), default=0)
    if 2 * longest > x.size:
        return frozen
    kept = [(start, stop) for start, stop in kept if 2 * (stop - start) >= longest]
    for start, stop in kept:
        frozen[start:stop] = True
    length = min(longest, max(SHORTEST, x.size // COMPARED))
    fewest = _fewest_changes(~same, frozen, q, length) if kept else 0
    return frozen if fewest >= USUAL_CHANGES * length else np.zeros(x.size, bool)


def _shortest(start: int, stop: int, samples: int) -> float:
    """Shortest stretch that counts: at the ends of a record a shifted channel is filled up."""
    inside = start > 0 and stop < samples
    return SHORTEST if inside else max(SHORTEST, END * samples)


def _fewest_changes(changes: np.ndarray, left_out: np.ndarray, q: np.ndarray, length: int) -> int:
    """Fewest changes within so many samples anywhere else while the joint moves."""
    starts = np.arange(0, q.size - length, max(1, length // 2))
    clean = ~sliding_window_view(left_out, length)[starts].any(axis=1)
    starts = np.array([k for k in starts[clean].tolist() if moves(q, k, k + length)], int)
    if starts.size < FEWEST:
        return 0
    return int(sliding_window_view(changes, length - 1)[starts].sum(axis=1).min())
