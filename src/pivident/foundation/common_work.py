"""What several methods would each compute from the same record, computed once.

    with shared_work() as shared:
        for method in methods:
            identify(problem, method)

Smoothed positions, least squares and the noise of the torques do not depend on the method that
begins with them. Results are kept until the block ends and must not be written to. ``saved`` is
the time that others took for what was reused, so that the cost of a method can still be stated as
if it stood alone.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Hashable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from contextvars import ContextVar
from dataclasses import dataclass, field
from typing import Any, TypeVar

Made = TypeVar("Made")


@dataclass(eq=False)
class SharedWork:
    """Results by what they are of, with the time that each takes."""

    saved: float = 0.0  # [s]
    kept: dict[Hashable, tuple[Any, float]] = field(default_factory=dict)


_shared: ContextVar[SharedWork | None] = ContextVar("shared_work", default=None)


@contextmanager
def shared_work() -> Iterator[SharedWork]:
    """Keep common results while the block runs; each thread for itself."""
    own = SharedWork()
    token = _shared.set(own)
    try:
        yield own
    finally:
        _shared.reset(token)


def work_in_common() -> AbstractContextManager[object]:
    """A block of shared work, or that within which it is called."""
    return nullcontext() if is_shared() else shared_work()


def is_shared() -> bool:
    """Whether others may take up what is made now: a block of shared work runs."""
    return _shared.get() is not None


def once(key: tuple[Hashable, ...], make: Callable[[], Made]) -> Made:
    """What ``make`` gives, or gave before for this key in the same block of shared work.

    ``key``: a name, and everything that the result depends on: problems and recordings
    themselves, which are equal to nothing else.
    """
    shared = _shared.get()
    if shared is None:
        return make()
    if key in shared.kept:
        made, seconds = shared.kept[key]
        shared.saved += seconds
        return made
    begin, saved = time.perf_counter(), shared.saved
    made = make()
    shared.kept[key] = made, time.perf_counter() - begin + shared.saved - saved
    return made
