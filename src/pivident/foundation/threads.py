"""A small thread pool for compiled code that releases the interpreter lock."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from contextlib import AbstractContextManager
from functools import cache
from typing import TypeVar

from threadpoolctl import ThreadpoolController

Item = TypeVar("Item")


def thread_count() -> int:
    """Threads to use: ``PIVIDENT_THREADS`` if set, else the cores given to this process."""
    wish = os.environ.get("PIVIDENT_THREADS", "")
    if wish.isdecimal() and len(wish) < 6 and int(wish) > 0:
        return int(wish)
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@cache
def _pool(process: int) -> ThreadPoolExecutor:
    """One pool per process: a forked child must not use its parent's threads."""
    return ThreadPoolExecutor(thread_count(), thread_name_prefix="pivident")


def run_in_threads(work: Callable[[Item], object], items: Iterable[Item]) -> None:
    """Call ``work`` on every item, in parallel; the first error is raised."""
    items = list(items)
    # work that is already inside the pool must not wait for the pool: it would wait for itself
    inside = threading.current_thread().name.startswith("pivident")
    if len(items) < 2 or thread_count() == 1 or inside:
        for item in items:
            work(item)
        return
    for _ in _pool(os.getpid()).map(work, items):
        pass


def linear_algebra_in_one_thread() -> AbstractContextManager[object]:
    """A context in which the libraries of linear algebra use one thread.

    Our matrices are of the size of the parameters, too small to be worth sharing; but a library
    that has shared one leaves its threads waiting in a loop for the next, on the processors that
    our own threads need, and its sums depend on the number of processors.
    """
    return _libraries().limit(limits=1, user_api="blas")


@cache
def _libraries() -> ThreadpoolController:
    """The libraries that are loaded: NumPy's and SciPy's are from the beginning."""
    return ThreadpoolController()
