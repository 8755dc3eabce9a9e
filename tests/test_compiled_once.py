"""Two processes that need one kernel: the second takes what the first has compiled."""

import subprocess
import sys

import psutil
import pytest

from tests.conftest import REPOSITORY

pytest.importorskip("fcntl", reason="locks of POSIX")

#: A kernel that calls another one.
KERNELS = """
from numba import njit

@njit(cache=True)
def inner(x):
    return x + 1

@njit(cache=True)
def outer(x):
    return 2 * inner(x)
"""

#: Compiles it as a worker does, and says how often it has; a folder of locks on the command line.
WORKER = """
import sys
from pathlib import Path
from tests.compiled_once import compiled_once
import kernels
print("ready", flush=True)
sys.stdin.readline()
with compiled_once(Path(sys.argv[1])):
    assert kernels.outer(1) == 4
print(*(sum(f.stats.cache_misses.values()) for f in (kernels.outer, kernels.inner)))
"""


def test_two_workers_compile_a_kernel_once(tmp_path, monkeypatch):
    (tmp_path / "kernels.py").write_text(KERNELS)
    monkeypatch.setenv("PYTHONPATH", f"{REPOSITORY}:{tmp_path}")
    workers = [
        subprocess.Popen(
            [sys.executable, "-c", WORKER, str(tmp_path / "locks")],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        for _ in range(2)
    ]
    for worker in workers:
        assert worker.stdout.readline() == "ready\n"
    for worker in workers:
        worker.stdin.write("\n")
        worker.stdin.flush()
    misses = [tuple(map(int, worker.communicate()[0].split())) for worker in workers]
    assert sorted(misses) == [(0, 0), (1, 1)]


def test_what_compiles_beside_the_workers_ends_with_them(tmp_path):
    from tests.compiled_once import compiling_beside

    others = set(psutil.Process().children())
    end = compiling_beside(tmp_path)
    (own,) = set(psutil.Process().children()) - others
    assert own.is_running() and str(tmp_path) in own.cmdline()
    end()
    assert not own.is_running()
