"""Times and loads."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

#: Length of a work's turn [s].
TURN = 0.1


@dataclass(frozen=True)
class Timing:
    """Times of one piece of work, warm.

    Attributes:
        ms: median time on the clock [ms].
        cpu_ms: median processor time of all its threads [ms].
        spread: median absolute deviation of the times on the clock [ms].
        load: load of the machine meanwhile.
    """

    ms: float
    cpu_ms: float
    spread: float
    load: float


def load() -> float:
    """Processes that are running or waiting to, mean over the last minute."""
    return os.getloadavg()[0] if hasattr(os, "getloadavg") else float("nan")


def side_by_side(works: Sequence[Callable[[], object]], repeats: int) -> list[Timing]:
    """Medians of works that take turns, so that each meets the same machine.

    In its turn a work is called until ``TURN`` has passed, and its mean counts. Where these are
    several calls the first is left out: it finds the caches full of the other work's numbers, which
    says more about the other work.

    Args:
        works: each is called once for its compilation, then for ``repeats`` turns.
        repeats: turns.
    """
    for work in works:
        work()
    wall, cpu = np.empty((2, len(works), repeats))
    for turn in range(repeats):
        for k, work in enumerate(works):
            wall[k, turn], cpu[k, turn] = _turn(work)
    return [timing_of(wall[k], cpu[k]) for k in range(len(works))]


def _turn(work: Callable[[], object]) -> tuple[float, float]:
    """Mean time on the clock and of the processors of one work's calls in its turn [s]."""
    begin = time.perf_counter()
    calls = []
    while not calls or time.perf_counter() - begin < TURN:
        started, ticks = time.perf_counter(), time.process_time()
        work()
        calls.append((time.perf_counter() - started, time.process_time() - ticks))
    wall, cpu = np.mean(calls[1:] or calls, axis=0)
    return float(wall), float(cpu)


def timing_of(wall: Sequence[float] | np.ndarray, cpu: Sequence[float] | np.ndarray) -> Timing:
    """Medians of times in seconds."""
    middle = float(np.median(wall))
    spread = float(np.median(np.abs(np.asarray(wall) - middle)))
    return Timing(1e3 * middle, 1e3 * float(np.median(cpu)), 1e3 * spread, load())


def timed(work: Callable[[], object], repeats: int) -> Timing:
    """Medians of one work."""
    return side_by_side([work], repeats)[0]
