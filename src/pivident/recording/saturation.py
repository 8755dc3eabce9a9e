"""Samples at which a torque is cut off at a limit.

A sample is called clipped where three things come together:

1. the torque sits at its largest or smallest value for several samples in a row;
2. the joint moves meanwhile, for a resting joint may hold one torque for as long as it likes;
3. that value is far more frequent than the next one inside the range, for a coarsely quantised
   signal also dwells on its highest level, but a smooth peak dwells on the levels below it almost
   as long (a parabola: 1 to √2-1), whereas a limit collects everything that lies beyond it.
"""

from __future__ import annotations

import numpy as np

#: Shortest run of equal values that counts.
MIN_RUN = 5

#: How much more frequent the limit is than the next value inside the range.
DOMINANCE = 10

#: A joint moves if it is at least this fast, relative to its range over the whole duration.
SLOWEST_MOTION = 0.1


def clipped_samples(tau: np.ndarray, q: np.ndarray) -> np.ndarray:
    """Which samples of one joint's torque are cut off."""
    clipped = np.zeros(len(tau), dtype=bool)
    for signal in (tau, -tau):
        limit = signal.max()
        inside = signal[signal < limit]
        if not inside.size:
            continue
        at_limit = signal == limit
        at_next_value = np.count_nonzero(signal == inside.max())
        if np.count_nonzero(at_limit) < DOMINANCE * at_next_value:
            continue
        for start, stop in _runs(at_limit):
            if stop - start >= MIN_RUN and _moves(q, start, stop):
                clipped[start:stop] = True
    return clipped


def _runs(mask: np.ndarray) -> np.ndarray:
    """First and last-plus-one index of each run of true values, shape (runs, 2)."""
    edges = np.diff(mask.astype(np.int8), prepend=0, append=0)
    return np.column_stack([np.flatnonzero(edges == 1), np.flatnonzero(edges == -1)])


def _moves(q: np.ndarray, start: int, stop: int) -> bool:
    """Whether the joint travels during some samples, compared with its whole motion."""
    return bool(np.ptp(q[start:stop]) / (stop - start) > SLOWEST_MOTION * np.ptp(q) / len(q))
