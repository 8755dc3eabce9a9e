"""Many tasks on any ``concurrent.futures`` executor, each written once even after interruptions.

The numbers of a task depend on its key alone, so neither the number of workers nor their order
matters. Only a few tasks are queued at a time and finished ones are written in small portions, so
memory does not grow with their number.
"""

from __future__ import annotations

import math
import os
import signal
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Executor, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import AbstractContextManager, contextmanager
from typing import Any, Generic, Protocol, TypeVar, runtime_checkable

from pivident.foundation.progress import Say
from pivident.foundation.text.numbers import time_in_words
from pivident.foundation.threads import thread_count
from pivident.studies.many.batch.batch_errors import BatchError
from pivident.studies.many.batch.results_folder import ResultsFolder, Row

#: Finished tasks are written in portions of this size, or after this many seconds.
PORTION, PERIOD = 64, 10.0

#: Seconds between two lines of progress.
REPORT_PERIOD = 5.0

#: Tasks submitted per worker: one running, one waiting.
AHEAD = 2

#: A task whose worker died this often, alone from the second time on, is recorded as lost.
DEATHS = 3

#: Number of worker deaths in a row, without a result in between, after which the batch stops.
MAX_DEATHS = 3 * DEATHS

#: Threads of the linear algebra libraries of a worker.
_LIBRARY_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")

#: Warning if the code has changed between the runs of a folder.
CHANGED = (
    "pivident's code has changed since the first results of this folder, so the results may be "
    "inconsistent"
)

#: Identity of a task: a number, a log. Tasks are computed in the order of their keys.
Key = TypeVar("Key")


class Pool(Protocol):
    """Source of executors: a new one is requested when workers have died."""

    workers: int

    def __call__(self) -> AbstractContextManager[Executor]:
        """A context with an executor."""
        ...


@runtime_checkable
class Watched(Protocol):
    """A pool that can lose all of its workers without its tasks ending with an error."""

    def check(self) -> None:
        """Raise BrokenProcessPool if the workers can be restarted, else BatchError."""
        ...


class Processes:
    """Worker processes on this machine, by default one for each core."""

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
                for process in processes:  # their current results are not needed
                    process.terminate()
                for process in processes:
                    process.join()


class GivenExecutor:
    """An executor of the caller with ``workers`` tasks at a time; it is not shut down."""

    def __init__(self, executor: Executor, workers: int) -> None:
        self.executor, self.workers = executor, workers

    @contextmanager
    def __call__(self) -> Iterator[Executor]:
        """The executor."""
        yield self.executor


def pool_of(workers: int | None, executor: Executor | None) -> Pool:
    """The caller's executor, or processes of this machine; None: as many as it has threads."""
    return (
        Processes(workers)
        if executor is None
        else GivenExecutor(executor, workers or thread_count())
    )


def in_one_thread(work: Callable[[Any, Key], list[Row]], task: Any, key: Key) -> list[Row]:
    """``work`` in a worker process with one thread: workers share the cores."""
    os.environ["PIVIDENT_THREADS"] = "1"
    return work(task, key)


class Runner(Generic[Key]):
    """Computation of many tasks.

    ``task`` is the shared part, sent to the workers with each key; ``work`` returns the rows of a
    task from both, ``lost`` those of a task whose worker died each time. ``total`` includes the
    finished tasks; ``title`` and ``noun`` appear in progress lines.
    """

    def __init__(
        self,
        task: Any,
        folder: ResultsFolder,
        pool: Pool,
        work: Callable[[Any, Key], list[Row]],
        lost: Callable[[Any, Key, int], list[Row]],
        title: str,
        total: int,
        say: Say,
        noun: str = "runs",
    ) -> None:
        self.task, self.folder, self.pool, self.work, self.lost = task, folder, pool, work, lost
        self.title, self.total, self.say, self.noun = title, total, say, noun
        self.finished: list[list[Row]] = []
        self.written = -math.inf  # the first result is written at once
        self.reported = time.monotonic()
        self.deaths: Counter[Key] = Counter()
        self.broken = 0

    def compute(self, missing: Sequence[Key]) -> None:
        """Compute tasks and write all that finish, even if an error occurs."""
        begin, at_hand = time.monotonic(), self.total - len(missing)
        waiting = list(missing)[::-1]
        self.say(f"{self.title}: starting {self.pool.workers} worker(s)")
        try:
            while waiting:
                try:
                    with self.pool() as executor:
                        self._drain(executor, waiting, begin, at_hand)
                except BrokenProcessPool:  # it broke before it accepted a task
                    self._recover({}, waiting)
        finally:
            self._write()

    def _drain(self, executor: Executor, waiting: list[Key], begin: float, at_hand: int) -> None:
        """Submit and collect until no task waits, or the pool breaks."""
        running: dict[Future[list[Row]], Key] = {}
        try:
            while waiting or running:
                while waiting and self._has_room(waiting[-1], running):
                    running[executor.submit(self.work, self.task, waiting[-1])] = waiting[-1]
                    waiting.pop()  # only now: a broken pool does not accept it
                ready, _ = wait(running, timeout=REPORT_PERIOD, return_when=FIRST_COMPLETED)
                if not ready and isinstance(self.pool, Watched):
                    self.pool.check()
                for future in ready:
                    self.finished.append(self._rows(future, running))
                self._write_now_and_then()
                self._report(begin, at_hand, len(waiting) + len(running))
        except BrokenProcessPool:
            self._recover(running, waiting)
        finally:
            for future in running:
                future.cancel()

    def _has_room(self, key: Key, running: dict[Future[list[Row]], Key]) -> bool:
        """Whether a task may be submitted; one that may have killed a worker runs alone."""
        if self.deaths[key] or any(self.deaths[other] for other in running.values()):
            return not running
        return len(running) < AHEAD * self.pool.workers

    def _rows(self, future: Future[list[Row]], running: dict[Future[list[Row]], Key]) -> list[Row]:
        """The rows of a finished task; a task that a cluster gave up is recorded as lost."""
        error = future.exception()
        if isinstance(error, BrokenProcessPool):
            raise error
        key = running.pop(future)
        if error is None:
            self.broken = 0
            return future.result()
        if type(error).__name__ == "KilledWorker":
            return self.lost(self.task, key, DEATHS)
        raise error

    def _recover(self, running: dict[Future[list[Row]], Key], waiting: list[Key]) -> None:
        """After the death of a worker, keep finished tasks and queue the others again."""
        again = []
        for future, key in running.items():
            if future.done() and not future.cancelled() and future.exception() is None:
                self.finished.append(future.result())
                continue
            again.append(key)
        for key in again[::-1]:  # they were submitted in order
            self.deaths[key] += 1
            if self.deaths[key] >= DEATHS:
                self.finished.append(self.lost(self.task, key, self.deaths[key]))
            else:
                waiting.append(key)
        running.clear()
        self.say(f"{self.title}: a worker has died; its {self.noun} are computed again")
        self._write()
        self.broken += 1
        if self.broken >= MAX_DEATHS:
            raise BatchError(
                f"workers died {self.broken} times in a row",
                advice="is there enough memory? A script that starts them needs 'if __name__ == "
                '"__main__":\' around its code. Finished results are on disk; run the same '
                "command to continue",
            )

    def _write_now_and_then(self) -> None:
        many = len(self.finished) >= PORTION
        if self.finished and (many or time.monotonic() - self.written > PERIOD):
            self._write()

    def _write(self) -> None:
        finished, self.finished = self.finished, []
        self.folder.append([row for rows in finished for row in rows])
        self.written = time.monotonic()

    def _report(self, begin: float, at_hand: int, left: int) -> None:
        """One progress line every few seconds, and the last one."""
        now = time.monotonic()
        if left and now - self.reported < REPORT_PERIOD:
            return
        self.reported, done = now, self.total - left
        line = f"{self.title}: {done} of {self.total} {self.noun}"
        if done > at_hand:
            pace = (now - begin) / (done - at_hand)
            rest = f", about {time_in_words(pace * left)} to go" if left else ""
            line += f", {pace:.2f} s each{rest}"
        self.say(line)


def _prepare_worker() -> None:
    """Let a worker ignore Ctrl-C, and end with its parent."""
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
