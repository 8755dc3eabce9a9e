"""Search for the coefficients of a motion: several starts side by side, the best kept."""

from __future__ import annotations

import time
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from pivident.excitation.descent import Best, Descent
from pivident.excitation.objective import Objective
from pivident.excitation.random_motions import random_coefficients
from pivident.text.numbers import percent
from pivident.threads import linear_algebra_in_one_thread, thread_count

#: Random motions of which the best begins a search.
DRAWS = 16

#: Share by which standard errors must have fallen, and seconds passed, for another line.
REPORTED_SHARE, REPORTED_SECONDS = 0.95, 2.0


@dataclass(frozen=True, eq=False)
class Search:
    """A search with several starts side by side."""

    objective: Objective
    home: np.ndarray | None  # posture at both ends; None: free
    seed: int
    seconds: float
    say: Callable[[str], None]

    def run(self, first: np.ndarray | None = None) -> Best:
        """Search until the time is over; an interruption ends it with the best so far.

        ``first``: coefficients of a motion to begin with, shape (size, joints).
        """
        deadline = time.perf_counter() + self.seconds
        best, workers = Best(deadline), thread_count()
        # threads of this name do not share their work with others: each has a start of its own
        threads = ThreadPoolExecutor(workers + 1, thread_name_prefix="pivident-search")
        with linear_algebra_in_one_thread(), threads as pool:
            jobs: list[Future[None]] = []
            try:
                pool.submit(self._report, best)
                for worker in range(workers):
                    jobs.append(pool.submit(self._starts, worker, workers, first, best))
                for job in jobs:
                    job.result()
            except KeyboardInterrupt:
                self.say("interrupted: the best motion so far is kept")
                best.interrupted = True
                best.ended.set()
                for job in jobs:
                    job.result()
            finally:  # the pool waits for its threads, and they for this
                best.ended.set()
        return best

    def _starts(self, worker: int, workers: int, first: np.ndarray | None, best: Best) -> None:
        """One start after the other until the time is over."""
        number = worker
        while not best.is_over:
            start = first if number == 0 and first is not None else self._random(number, best)
            if start is not None:
                Descent.of(self.objective, start, self.home is not None, best).run()
            number += workers

    def _random(self, number: int, best: Best) -> np.ndarray | None:
        """The best of some random motions as large as the limits allow; None if none is allowed."""
        rng = np.random.default_rng([self.seed, number])
        chosen, least = None, np.inf
        for _ in range(DRAWS):
            drawn = random_coefficients(self.objective.constraints, rng, self.home)
            if best.is_over:
                break
            if drawn is None:
                continue
            value = self.objective.value(drawn)
            if value < least or chosen is None:
                chosen, least = drawn, value
        if chosen is not None and np.isfinite(least):
            best.offer(least, chosen, first=True)
        return chosen

    def _report(self, best: Best) -> None:
        """Progress, now and then."""
        reported = 1.0
        while not best.ended.wait(REPORTED_SECONDS) and not best.is_over:
            if not np.isfinite(best.first):
                continue
            share = float(np.exp(0.5 * (best.value - best.first)))
            if share < REPORTED_SHARE * reported:
                reported = share
                cond = self.objective.criterion.name == "cond"
                whose = "the condition number is" if cond else "standard errors are"
                self.say(
                    f"{whose} down to {percent(100 * share)} of the best random motion's "
                    f"({best.evaluations} motions tried)"
                )
