"""What one thread of this machine can do: arithmetic, memory bandwidth, latency of a chain."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np
from numba import njit

#: Values that are multiplied and added side by side, more than registers need to hide the latency.
LANES = 96

#: Elements of each array of the triad: far more than the last cache holds.
TRIAD = 8_000_000


@dataclass(frozen=True)
class Bounds:
    """Ceilings of one thread.

    Attributes:
        multiply_adds: independent multiply-adds in registers [1/s].
        bandwidth: bytes read and written by a = b + s c on arrays beyond the caches [B/s].
        latency: multiply-add that waits for the one before it [s].
    """

    multiply_adds: float
    bandwidth: float
    latency: float


@njit(cache=True, nogil=True, fastmath={"contract"})
def _independent(turns, lanes, factor):
    """Multiply-adds on lanes that do not wait for each other."""
    for _ in range(turns):
        for i in range(lanes.size):
            lanes[i] = lanes[i] * factor + 1e-9


@njit(cache=True, nogil=True, fastmath={"contract"})
def _unrolled(turns, x, factor):
    """The same in twelve vectors of eight that stay in registers."""
    a = np.empty(96)
    for i in range(96):
        a[i] = x + i
    for _ in range(turns):
        for i in range(96):
            a[i] = a[i] * factor + 1e-9
    return a.sum()


@njit(cache=True, nogil=True, fastmath={"contract"})
def _chain(turns, x, factor):
    """Each multiply-add needs the result of the one before."""
    for _ in range(turns):
        x = x * factor + 1e-9
    return x


@njit(cache=True, nogil=True)
def _triad(a, b, c, s):
    for i in range(a.size):
        a[i] = b[i] + s * c[i]


def measure(repeats: int = 7) -> Bounds:
    """Measure the ceilings: the best of several turns, since a ceiling is not a median."""
    turns = 2_000_000
    lanes = np.ones(LANES)
    a, b, c = np.zeros(TRIAD), np.ones(TRIAD), np.ones(TRIAD)
    rate = max(
        LANES * turns / _least(lambda: _independent(turns, lanes, 0.999), repeats),
        LANES * turns / _least(lambda: _unrolled(turns, 1.0, 0.999), repeats),
    )
    latency = _least(lambda: _chain(turns, 1.0, 0.999), repeats) / turns
    bandwidth = 24 * TRIAD / _least(lambda: _triad(a, b, c, 3.0), repeats)
    return Bounds(rate, bandwidth, latency)


def _least(work, repeats: int) -> float:
    """Least processor time of a work [s]."""
    work()
    times = []
    for _ in range(repeats):
        started = time.thread_time()
        work()
        times.append(time.thread_time() - started)
    return min(times)
