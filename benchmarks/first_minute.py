"""How long the demonstration takes on an empty cache of compiled code, and what compiles in it.

    python benchmarks/first_minute.py

`pivident demo` runs in a process of its own, with an empty folder as numba's cache. The first
table has a line for each kernel that Python called, with the functions it was compiled with, in
processor time of the thread that compiled. A kernel that stands there twice was compiled for two
kinds of arguments. Beside it stand processor time and wall time of the whole run, and of a second
one that finds everything in the cache.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import threading
import time
from collections import Counter
from pathlib import Path
from typing import Any

from numba.core import event


class Stopwatch(event.Listener):
    """Processor time of everything numba compiles, by thread and nesting.

    Attributes:
        kernels: name, processor time [s] and number of functions compiled for each kernel that
            was not compiled as a part of another.
        functions: how often each function was compiled.
    """

    def __init__(self) -> None:
        self.kernels: list[tuple[str, float, int]] = []
        self.functions: Counter[str] = Counter()
        self._begun: dict[int, list[float]] = {}
        self._within: Counter[int] = Counter()

    def on_start(self, event: Any) -> None:  # noqa: D102
        self._begun.setdefault(threading.get_ident(), []).append(time.thread_time())

    def on_end(self, event: Any) -> None:  # noqa: D102
        thread, function = threading.get_ident(), event.data["dispatcher"].py_func
        seconds = time.thread_time() - self._begun[thread].pop()
        name = f"{function.__module__}.{function.__qualname__}"
        self.functions[name] += 1
        self._within[thread] += 1
        if not self._begun[thread]:
            self.kernels.append((name, seconds, self._within.pop(thread)))


def demonstrate(folder: str) -> None:
    """Run the demonstration in this process; the last line of its output is what was measured."""
    stopwatch = Stopwatch()
    event.register("numba:compile", stopwatch)
    begin = time.perf_counter()
    from pivident.app.cli.workflow import run_demo

    run_demo(Path(folder) / "demo")
    wall, processor = time.perf_counter() - begin, time.process_time()
    print(json.dumps([wall, processor, stopwatch.kernels, stopwatch.functions]))


def measured(folder: str) -> list[Any]:
    """Wall and processor time [s] of a run with its cache in ``folder``, and what it compiled."""
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(Path(folder) / "cache")}
    command = [sys.executable, __file__, folder]
    run = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    return json.loads(run.stdout.splitlines()[-1])


def main() -> None:
    with tempfile.TemporaryDirectory() as folder:
        first, second = measured(folder), measured(folder)
    wall, processor, kernels, functions = first
    print(f"{'kernel':62s} {'seconds':>8s} {'functions':>9s}")
    for name, seconds, count in kernels:
        print(f"{name:62s} {seconds:8.2f} {count:9d}")
    compiling = sum(seconds for _, seconds, _ in kernels)
    print(f"{'all':62s} {compiling:8.2f} {sum(functions.values()):9d}")
    own = {name: n for name, n in functions.items() if name.startswith("pivident") and n > 1}
    print("compiled more than once:", ", ".join(f"{n} × {name}" for name, n in own.items()) or "-")
    print(f"load of the machine {os.getloadavg()[0]:.1f}, {os.cpu_count()} processors")
    print(f"empty cache: {wall:.1f} s, {processor:.1f} s of processor time")
    print(f"full cache:  {second[0]:.1f} s, {second[1]:.1f} s of processor time")


if __name__ == "__main__":
    if len(sys.argv) > 1:
        demonstrate(sys.argv[1])
    else:
        main()
