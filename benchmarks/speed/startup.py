"""Cold and warm starts of processes."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass

import numpy as np

_PIV = """
from speed.workloads import whole_job
from pivident.estimation.identify import identify
identify(whole_job()[1], "piv")
"""


@dataclass(frozen=True)
class Start:
    """A process from its start to its end.

    Attributes:
        what: what it does.
        seconds: median on the clock [s].
        cpu_seconds: median processor time [s].
        goal: largest time asked for [s].
    """

    what: str
    seconds: float
    cpu_seconds: float
    goal: float


def all_starts(repeats: int, empty_cache: bool) -> list[Start]:
    """Python alone, ``import pivident``, ``pivident --help``, and a PIV with and without caches.

    Args:
        repeats: processes of each kind.
        empty_cache: also compile everything once, which takes a minute.
    """
    run = [sys.executable]
    rows = [
        _start("python alone", [*run, "-c", "pass"], repeats, np.nan),
        _start("import pivident", [*run, "-c", "import pivident"], repeats, 0.3),
        _start("pivident --help", [*run, "-m", "pivident", "--help"], repeats, 0.4),
        _start("IDIM-PIV, cached kernels, file reading included", [*run, "-c", _PIV], repeats, 3.0),
    ]
    if empty_cache:
        with tempfile.TemporaryDirectory() as folder:
            rows.append(
                _start(
                    "IDIM-PIV, empty caches: everything compiled",
                    [*run, "-c", _PIV],
                    1,
                    np.nan,
                    {"NUMBA_CACHE_DIR": folder},
                )
            )
    return rows


def _start(
    what: str, command: list[str], repeats: int, goal: float, more: dict[str, str] | None = None
) -> Start:
    """Median of several processes; the first one, which fills caches, does not count."""
    from .scaling import HOME

    wall, cpu = [], []
    for turn in range(repeats + 1 if repeats > 1 else 1):
        started, ticks = time.perf_counter(), os.times()
        subprocess.run(
            command, check=True, cwd=HOME, env=os.environ | (more or {}), capture_output=True
        )
        ended = os.times()
        if turn or repeats == 1:
            wall.append(time.perf_counter() - started)
            cpu.append(
                ended.children_user + ended.children_system
                - ticks.children_user - ticks.children_system
            )  # fmt: skip
    return Start(what, float(np.median(wall)), float(np.median(cpu)), goal)
