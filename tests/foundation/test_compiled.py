"""Compiled functions and their cache."""

import os
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

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
