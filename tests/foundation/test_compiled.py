"""Compiled functions and their cache."""

import gc
import os
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest
from numba import njit
from numba.core import event as events
from numba.core.errors import TypingError

from pivident.foundation.compiled import is_compiled


def test_a_kernel_is_compiled_where_its_cache_has_it(tmp_path):
    kernel = SimpleNamespace(
        stats=SimpleNamespace(cache_path=str(tmp_path)), py_func=SimpleNamespace(__name__="run")
    )
    assert not is_compiled(kernel)
    Path(tmp_path, "loop.runs-3.py311.nbi").touch()
    assert not is_compiled(kernel)
    Path(tmp_path, "loop.run-3.py311.nbi").touch()
    assert is_compiled(kernel)
    assert is_compiled(len)  # nothing is compiled at all


SCRIPT = """
import sys
import numpy as np
from pivident.foundation.compiled import allocating, kernel

@allocating
def twice(x):
    return 2.0 * x

@kernel
def add(x, y):
    for i in range(x.size):
        x[i] += np.sqrt(y[i])

x = np.ones(3)
add(x, twice(np.full(3, 8.0)))
loaded = sum(f.stats.cache_hits[s] for f in (twice, add) for s in f.stats.cache_hits)
print(x.tolist(), loaded, "numba.misc.cffiimpl" in sys.modules)
add(np.ones(3, np.float32), np.ones(3))  # another signature, to be compiled
"""


def test_what_is_loaded_needs_no_compiler(tmp_path):
    """The second process loads from the cache, and still compiles what is not there."""
    script = tmp_path / "script.py"
    script.write_text(SCRIPT)
    said = [
        subprocess.run(
            [sys.executable, script], check=True, capture_output=True, text=True,
            env={**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)},
        ).stdout.split("] ")
        for _ in range(2)
    ]  # fmt: skip
    assert said == [["[5.0, 5.0, 5.0", "0 True\n"], ["[5.0, 5.0, 5.0", "2 False\n"]]


class Watcher(events.Listener):
    """Whether garbage is collected while numba compiles, at every start and end."""

    def __init__(self):
        self.seen = []

    def on_start(self, event):
        self.seen.append(gc.isenabled())

    def on_end(self, event):
        self.seen.append(gc.isenabled())


@pytest.mark.parametrize("wanted", [True, False])
def test_garbage_is_collected_around_the_compiler_as_before_and_not_within(wanted):
    inner = njit(lambda x: x + 1.0)
    outer = njit(lambda x: inner(x) + 1.0)
    before = gc.isenabled()
    watcher = Watcher()
    events.register("numba:compile", watcher)
    (gc.enable if wanted else gc.disable)()
    try:
        assert outer(1.0) == 3.0
        inside, watcher.seen = watcher.seen, []
        assert inside == [False, False, False, wanted]  # two functions, one within the other
        with pytest.raises(TypingError):
            outer("text")
        assert gc.isenabled() is wanted and watcher.seen[-1] is wanted
    finally:
        events.unregister("numba:compile", watcher)
        (gc.enable if before else gc.disable)()
