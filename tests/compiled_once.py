"""Several workers of pytest compile no kernel twice: who is first holds its lock, the others wait.

Numba compiles in every process whatever no cache has yet, and its files of two processes that
compile the same function at the same time replace one another. A function holds its lock while
those that it calls are compiled; as no two functions call one another, nobody waits in a circle.
"""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from numba.core.caching import Cache
from numba.core.dispatcher import Dispatcher


class Locks:
    """Locks of functions, as empty files; a process that ends gives back all of its own.

    Attributes:
        folder: of the files.
        held: open files of the locks that this process has, by their path.
    """

    def __init__(self, folder: Path):
        folder.mkdir(exist_ok=True)
        self.folder = folder
        self.held: dict[Path, int] = {}

    def path(self, cache: Cache) -> Path:
        """The lock of a function, by the place where it is kept."""
        place = os.fspath(cache._cache_file._index_path)
        return self.folder / hashlib.sha256(place.encode()).hexdigest()

    def take(self, cache: Cache) -> None:
        """Wait for the lock of a function, unless this process has it already."""
        import fcntl

        if (path := self.path(cache)) not in self.held:
            lock = os.open(path, os.O_CREAT | os.O_RDWR)
            fcntl.flock(lock, fcntl.LOCK_EX)
            self.held[path] = lock

    def give_back(self, cache: Cache) -> None:
        """Let the next one in, if this process has the lock."""
        if (path := self.path(cache)) in self.held:
            os.close(self.held.pop(path))


@contextmanager
def compiled_once(folder: Path) -> Iterator[None]:
    """Within, who finds a function in no cache waits for its lock, and then looks again."""
    locks = Locks(folder)
    load, compiled = Cache.load_overload, Dispatcher.compile

    def looked_up(cache: Cache, *signature: Any) -> Any:
        found = load(cache, *signature)
        if found is None:
            locks.take(cache)
            found = load(cache, *signature)
        return found

    def compiled_alone(kernel: Dispatcher, signature: Any) -> Any:
        try:
            return compiled(kernel, signature)
        finally:
            if isinstance(kernel._cache, Cache):
                locks.give_back(kernel._cache)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Cache, "load_overload", looked_up)
        patch.setattr(Dispatcher, "compile", compiled_alone)
        yield


def compiling_beside(folder: Path) -> Callable[[], None]:
    """Start a process that compiles what every robot needs; returns what ends it."""
    command = [sys.executable, "-m", __name__, folder]
    checkout = Path(__file__).resolve().parents[1]
    process = subprocess.Popen(command, cwd=checkout, stdin=subprocess.DEVNULL)

    def end() -> None:
        process.kill()
        process.wait()

    return end


if __name__ == "__main__":
    from pivident.app.cli.compile_ahead import compile_shared
    from pivident.dynamics.regressor_kernels import observe
    from pivident.foundation.compiled import is_compiled
    from pivident.loop.simulation.loop_kernel import run_loop

    if not (is_compiled(observe) and is_compiled(run_loop)):
        with compiled_once(Path(sys.argv[1])):
            compile_shared()
