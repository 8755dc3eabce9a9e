"""Many runs on any ``concurrent.futures`` executor, each written once, whatever ends the study.

A run's numbers depend on its number alone, so neither the number of workers nor their order
matters. Only a few runs wait at a time and finished ones go to disk in small portions: memory does
not grow with the study.
"""

from __future__ import annotations

import math
import os
import signal
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_COMPLETED, Executor, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import Protocol, runtime_checkable

from pivident.study.motion import FILE as TRAJECTORY
from pivident.study.motion import as_json, optimised_series
from pivident.study.run import Row, Task, execute, execute_alone, lost_rows
from pivident.study.scenario import Scenario
from pivident.study.store import Store
from pivident.threads import thread_count

#: Finished runs are written when there are so many, or after so many seconds.
PORTION, PERIOD = 64, 10.0

#: Seconds between two lines of progress.
TELLING = 5.0

#: Runs submitted per worker: one that is computed, one that waits.
AHEAD = 2

#: A run whose worker has died so often, alone from the second time on, is recorded as lost.
DEATHS = 3

#: Threads of the linear algebra libraries of a worker.
_LIBRARY_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")

#: What has to be said where the code has changed between the runs of a folder.
CHANGED = (
    "pivident's code has changed since the first runs of this folder, so their numbers may not "
    "belong together"
)

Say = Callable[[str], None]


class Pool(Protocol):
    """Where executors come from: a new one is asked for when workers have died."""

    workers: int

    def __call__(self) -> AbstractContextManager[Executor]:
        """A context with an executor."""
        ...


@runtime_checkable
class Watched(Protocol):
    """A pool that can lose all of its workers without its runs ending with an error."""

    def check(self) -> None:
        """Say whether it still has workers.

        Raises:
            BrokenProcessPool: it has none, and a new one has to be made.
            StudyError: it has none, and nothing can be done about it here.
        """
        ...


class Processes:
    """Worker processes on this machine.

    Args:
        workers: how many; None: one for each core.
    """

    def __init__(self, workers: int | None = None) -> None:
        self.workers = workers or thread_count()

    @contextmanager
    def __call__(self) -> Iterator[Executor]:
        """A pool of processes that ends with this context, or with this process."""
        import multiprocessing

        with _environment({name: "1" for name in (*_LIBRARY_THREADS, "PIVIDENT_THREADS")}):
            pool = ProcessPoolExecutor(
                self.workers, multiprocessing.get_context("spawn"), initializer=_prepare_worker
            )
            try:
                yield pool
            finally:
                processes = list((pool._processes or {}).values())
                pool.shutdown(wait=False, cancel_futures=True)
                for process in processes:  # what they compute now is not wanted any more
                    process.terminate()
                for process in processes:
                    process.join()


class Given:
    """An executor of the caller's; it is not shut down.

    Args:
        executor: any ``concurrent.futures`` executor.
        workers: how many runs it computes at a time.
    """

    def __init__(self, executor: Executor, workers: int) -> None:
        self.executor, self.workers = executor, workers

    @contextmanager
    def __call__(self) -> Iterator[Executor]:
        """The executor."""
        yield self.executor


def run_study(
    scenario: Scenario,
    folder: str | Path,
    runs: int | None = None,
    *,
    workers: int | None = None,
    executor: Executor | None = None,
    pool: Pool | None = None,
    say: Say | None = None,
) -> Store:
    """Compute the runs of a scenario that are not in the folder yet.

    Args:
        scenario: a scenario without conditions, or one condition.
        folder: for the results; it is made, or belongs to the same scenario.
        runs: how many runs there are to be in all; None: as the scenario says.
        workers: processes on this machine, or runs at a time of ``executor``.
        executor: any executor; what it runs must be able to import pivident.
        pool: in place of the two, see ``cluster``.
        say: progress.

    Returns:
        The folder with all runs.

    Raises:
        StudyFolderError: the folder cannot be used; what is in it is as it was.
        ExperimentError: the scenario contradicts itself.
    """
    say = say or (lambda line: None)
    total = scenario.content.runs if runs is None else runs
    if runs is not None and runs != scenario.content.runs:
        scenario = scenario.with_runs(total)
    if pool is None:
        at_a_time = workers or thread_count()
        pool = Processes(at_a_time) if executor is None else Given(executor, at_a_time)
    store = Store(Path(folder))
    with store.opened(scenario, total):
        series = optimised_series(scenario, store.folder, say)
        if series is not None and not (store.folder / TRAJECTORY).is_file():
            store.write(TRAJECTORY, as_json(scenario, series))
        done = store.done()
        missing = [run for run in range(total) if run not in done]
        if done and missing and len(store.programs()) > 1:
            say(f"{scenario.title}: {CHANGED}")
        if done and missing:
            say(f"{scenario.title}: {total - len(missing)} runs are there, {len(missing)} to do")
        work = execute if executor is not None else execute_alone
        if missing:
            task = Task.of(scenario, series)
            _Runner(task, store, pool, work, scenario.title, total, say).compute(missing)
    return store


class _Runner:
    """The runs of one study while they are computed."""

    def __init__(
        self,
        task: Task,
        store: Store,
        pool: Pool,
        work: Callable[[Task, int], list[Row]],
        title: str,
        total: int,
        say: Say,
    ) -> None:
        self.task, self.store, self.pool, self.work = task, store, pool, work
        self.title, self.total, self.say = title, total, say
        self.finished: list[Row] = []
        self.written, self.told = -math.inf, time.monotonic()  # the first run is written at once
        self.deaths: Counter[int] = Counter()

    def compute(self, missing: list[int]) -> None:
        """Compute and write runs; whatever happens, those that have finished are written."""
        begin, at_hand = time.monotonic(), self.total - len(missing)
        waiting = missing[::-1]
        self.say(f"{self.title}: starting {self.pool.workers} worker(s)")
        try:
            while waiting:
                with self.pool() as executor:
                    self._drain(executor, waiting, begin, at_hand)
        finally:
            self._write()

    def _drain(self, executor: Executor, waiting: list[int], begin: float, at_hand: int) -> None:
        """Submit and collect until nothing waits, or the pool breaks: then some wait again."""
        running: dict[Future[list[Row]], int] = {}
        try:
            while waiting or running:
                while waiting and self._has_room(waiting[-1], running):
                    running[executor.submit(self.work, self.task, waiting[-1])] = waiting[-1]
                    waiting.pop()  # only now: a pool that is broken does not take it
                ready, _ = wait(running, timeout=TELLING, return_when=FIRST_COMPLETED)
                if not ready and isinstance(self.pool, Watched):
                    self.pool.check()
                for future in ready:
                    self.finished += self._rows(future, running)
                self._write_now_and_then()
                self._tell(begin, at_hand, len(waiting) + len(running))
        except BrokenProcessPool:
            self._recover(running, waiting)
        finally:
            for future in running:
                future.cancel()

    def _has_room(self, run: int, running: dict[Future[list[Row]], int]) -> bool:
        """Whether a run may be submitted: one that may have killed a worker is computed alone."""
        if self.deaths[run] or any(self.deaths[other] for other in running.values()):
            return not running
        return len(running) < AHEAD * self.pool.workers

    def _rows(self, future: Future[list[Row]], running: dict[Future[list[Row]], int]) -> list[Row]:
        """The rows of a finished run; what a cluster could not compute is recorded as lost."""
        error = future.exception()
        if isinstance(error, BrokenProcessPool):
            raise error
        run = running.pop(future)
        if error is None:
            return future.result()
        if type(error).__name__ == "KilledWorker":
            return lost_rows(self.task, run, DEATHS)
        raise error

    def _recover(self, running: dict[Future[list[Row]], int], waiting: list[int]) -> None:
        """A worker has died: keep what is finished, do the others again."""
        again = []
        for future, run in running.items():
            if future.done() and not future.cancelled() and future.exception() is None:
                self.finished += future.result()
                continue
            again.append(run)
        for run in sorted(again, reverse=True):
            self.deaths[run] += 1
            if self.deaths[run] >= DEATHS:
                self.finished += lost_rows(self.task, run, self.deaths[run])
            else:
                waiting.append(run)
        running.clear()
        self.say(f"{self.title}: a worker has died; its runs are computed again")
        self._write()

    def _write_now_and_then(self) -> None:
        many = len({row["run"] for row in self.finished}) >= PORTION
        if self.finished and (many or time.monotonic() - self.written > PERIOD):
            self._write()

    def _write(self) -> None:
        rows, self.finished = self.finished, []
        self.store.append(rows)
        self.written = time.monotonic()

    def _tell(self, begin: float, at_hand: int, left: int) -> None:
        """One line every few seconds, and the last one."""
        now = time.monotonic()
        if left and now - self.told < TELLING:
            return
        self.told, done = now, self.total - left
        line = f"{self.title}: {done} of {self.total} runs"
        if done > at_hand:
            pace = (now - begin) / (done - at_hand)
            rest = f", about {_minutes(pace * left)} to go" if left else ""
            line += f", {pace:.2f} s each{rest}"
        self.say(line)


def _minutes(seconds: float) -> str:
    return f"{seconds:.0f} s" if seconds < 90 else f"{seconds / 60:.0f} min"


def _prepare_worker() -> None:
    """A worker leaves Ctrl-C to its parent, and ends when the parent does."""
    from multiprocessing import connection, parent_process

    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = parent_process()
    if parent is not None:
        threading.Thread(
            target=lambda: (connection.wait([parent.sentinel]), os._exit(1)), daemon=True
        ).start()


@contextmanager
def _environment(values: dict[str, str]) -> Iterator[None]:
    """Environment variables for processes that are started inside."""
    before = {name: os.environ.get(name) for name in values}
    os.environ.update(values)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value
