"""What several methods would each compute from the same record, computed once.

    with shared_work() as shared:
        for method in methods:
            identify(problem, method)

Smoothed positions, least squares and the noise of the torques do not depend on the method that
begins with them. Results are kept until the block ends and must not be written to. ``saved`` is
the time that others took for what was reused, so that the cost of a method can still be stated as
if it stood alone.

    with numbers_beside(experiment):
        check_experiment(experiment)

What a record is searched for, such as a delay, several commands need one after the other: `init`,
`check` and `identify`. Such numbers are kept in a file beside the experiment. They are found again
by a hash of all that they depend on, down to the bytes of the samples and the time stamps of this
program, so that nothing is taken from another record or version. The file may be deleted at any
time; where it cannot be read or written, or is damaged, the search is made as if it were not there.
"""

from __future__ import annotations

import hashlib
import json
import os
import time
from base64 import b64decode, b64encode
from collections.abc import Callable, Hashable, Iterable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext, suppress
from contextvars import ContextVar
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from pivident.foundation.errors import PividentError
from pivident.foundation.files import json_object, write_file
from pivident.foundation.version import __version__

Made = TypeVar("Made")

#: File of the numbers, beside the experiment file.
NUMBERS = ".pivident-numbers.json"

#: Most searches whose numbers are kept, those of the newest records, and the largest such file.
MAX_KEPT, MAX_BYTES = 500, 2**24


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


_numbers: ContextVar[dict[str, np.ndarray] | None] = ContextVar("numbers", default=None)


@contextmanager
def numbers_beside(experiment: Path) -> Iterator[None]:
    """Take up what records were searched for, and keep what they are searched for meanwhile."""
    file = experiment.parent / NUMBERS
    known = _read(file)
    token = _numbers.set(dict(known))
    try:
        yield
    finally:
        found = _numbers.get() or {}
        _numbers.reset(token)
        if found.keys() > known.keys():
            every = known | _read(file) | found  # another command may have written meanwhile
            texts = {key: b64encode(every[key].tobytes()).decode() for key in [*every][-MAX_KEPT:]}
            with suppress(PividentError, OSError):  # a folder that is read-only, or a full disk
                write_file(file, json.dumps({"sha256": _sha256_of(texts), "numbers": texts}))


def kept_numbers(
    of: Iterable[Any], shape: tuple[int, ...], search: Callable[[], np.ndarray]
) -> np.ndarray:
    """What a search gives, or gave for the same in a command before.

    Args:
        of: its name, and all that its numbers depend on: arrays, numbers, words.
        shape: of the numbers.
        search: gives them.
    """
    kept = _numbers.get()
    if kept is None:
        return search()
    digest = hashlib.sha256(_installation())
    for part in map(np.asarray, of):
        digest.update(f"{part.dtype} {part.shape} ".encode() + part.tobytes())
    found = kept.get(key := digest.hexdigest())
    if found is None or found.size != np.prod(shape):
        found = kept[key] = search()
    return found.reshape(shape)


def _read(file: Path) -> dict[str, np.ndarray]:
    """The numbers of a file by the hashes of what they are of; none of one that is damaged."""
    with suppress(OSError, KeyError, TypeError, ValueError):
        content = json_object(file, MAX_BYTES)
        texts = dict(content["numbers"])
        if content["sha256"] == _sha256_of(texts):
            return {key: np.frombuffer(b64decode(x, validate=True)) for key, x in texts.items()}
    return {}


def _sha256_of(texts: dict[str, str]) -> str:
    return hashlib.sha256(json.dumps(texts).encode()).hexdigest()


@cache
def _installation() -> bytes:
    """Version of the program and when it was last changed, which an editable one is at any time."""
    changed, folders = 0, [str(Path(__file__).parents[1])]
    for folder in folders:
        for entry in os.scandir(folder):
            if entry.is_dir():
                folders.append(entry.path)
            elif entry.name.endswith(".py"):
                changed = max(changed, entry.stat().st_mtime_ns)
    return f"{__version__} {changed}".encode()
