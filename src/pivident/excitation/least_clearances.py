"""How near bodies come to each other on a motion, between its samples too.

A distance d changes no faster than the joints allow, |ḋ| ≤ L = Σ_i |dq_i| |∂d/∂q_i|, with bounds of
the slopes that hold in every posture. Between samples h apart it is therefore at least

    (d_k + d_{k+1} - L h) / 2

(Lipschitz; Piyavskii 1972, Shubert 1972). Where this leaves a distance in doubt, samples are taken
in between, until it does not.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from pivident.collision.clearances import Clearances

#: Parts into which an interval in doubt is cut, and how often.
PARTS, LEVELS = 8, 5

#: What may remain in doubt [m].
TOLERANCE = 5e-5

#: Pairs that keep so much more than needed are not followed between the samples [m].
AMPLE = 0.03

#: Positions, speeds and accelerations at times, (3, samples, joints).
Motion = Callable[[np.ndarray], np.ndarray]


def least_clearances(
    clearances: Clearances, motion: Motion, t: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Least distance of every pair along a motion.

    Args:
        clearances: the pairs.
        motion: its positions, speeds and accelerations at times [s].
        t: samples to begin with, evenly spaced [s], shape (samples,).

    Returns:
        Distances [m] and instants [s], each (pairs,): at most `TOLERANCE` above the least distance
        for pairs that come near to what they need, those at the samples for others.
    """
    rows, needed = np.arange(len(clearances.names)), clearances.needed
    least, instant = np.full(rows.size, np.inf), np.full(rows.size, t[0])
    cuts = t[:, None]  # samples of each interval, one interval in each column
    for _ in range(LEVELS + 1):
        moved = motion(cuts.ravel())
        distance = clearances.distances(moved[0])
        nearest = distance.argmin(axis=1)
        closer = distance[rows, nearest] < least
        least = np.where(closer, distance[rows, nearest], least)
        instant = np.where(closer, cuts.ravel()[nearest], instant)
        low = _lowest_between(clearances, moved, distance, cuts)
        doubtful = low < np.minimum(least - TOLERANCE, needed + AMPLE)[:, None, None]
        own = doubtful.any(axis=0)
        if not own.any():
            return least, instant
        left, right = cuts[:-1][own], cuts[1:][own]
        cuts = left + np.linspace(0.0, 1.0, PARTS + 1)[:, None] * (right - left)
    # what is still in doubt counts as its bound
    return np.minimum(least, np.where(doubtful, low, np.inf).min(axis=(1, 2))), instant


def _lowest_between(
    clearances: Clearances, moved: np.ndarray, distance: np.ndarray, cuts: np.ndarray
) -> np.ndarray:
    """(d_k + d_{k+1} - L h)/2 of samples in each column, shape (pairs, samples - 1, columns).

    Within half a step of a sample a speed is at most |dq| + h/2 max |ddq|.
    """
    step = cuts[1, 0] - cuts[0, 0]
    speed = np.abs(moved[1]) + 0.5 * step * np.abs(moved[2]).max(axis=0)
    pace = (speed @ clearances.steepest.T).T.reshape(-1, *cuts.shape)
    d = distance.reshape(-1, *cuts.shape)
    return 0.5 * (d[:, :-1] + d[:, 1:] - step * np.maximum(pace[:, :-1], pace[:, 1:]))
