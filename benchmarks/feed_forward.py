"""Torques for feed-forward: what a call costs, of each way to ask for one.

    PIVIDENT_THREADS=1 python benchmarks/feed_forward.py [ROBOT ...]

Microseconds of processor time for one state, median of 15 turns that take all ways in turn, and the
same by state for 100,000 samples at once: ``torque`` of a model, the observation matrix built for
each call (``predict``), and the exported C function, called from C and from Python by ctypes.
"""

from __future__ import annotations

import ctypes
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

os.environ.setdefault("PIVIDENT_THREADS", "1")

import numpy as np

from pivident.dynamics.robot_regressor import regressor_of
from pivident.models import runnable_model, to_c
from pivident.models.export.c_source import c_compiler
from pivident.robot.gallery import load_robot

TURNS, CALLS, SAMPLES = 15, 2000, 100_000
C_LOOP = """#include "arm.h"
void loop(size_t calls, const double *q, const double *dq, const double *ddq, double *tau)
{
    for (size_t k = 0; k < calls; ++k)
        arm_inverse_dynamics(q, dq, ddq, tau);
}
"""


def main() -> None:
    """Print a table for each robot."""
    for name in sys.argv[1:] or ["staubli_tx40", "planar_2r"]:
        with tempfile.TemporaryDirectory() as folder:
            print(f"\n{name}")
            for way, microseconds in measured(ways_to_ask(name, Path(folder))).items():
                print(f"  {way:32s} {microseconds:8.2f} µs")


def ways_to_ask(name: str, folder: Path) -> dict[str, tuple[Callable[[], object], int]]:
    """Work by its name, with the number of states in it."""
    robot = load_robot(name)
    model = runnable_model(robot)
    one = np.random.default_rng(0).uniform(-1.0, 1.0, (3, robot.size))
    many = np.random.default_rng(1).uniform(-1.0, 1.0, (3, SAMPLES, robot.size))

    def predict() -> object:
        return regressor_of(robot, model.parameters).torque(*one[:, None], model.values)

    ways: dict[str, tuple[Callable[[], object], int]] = {
        "torque, one state": (_repeated(lambda: model.torque(*one), CALLS), CALLS),
        "predict, one state": (_repeated(predict, 20), 20),
        f"torque, {SAMPLES:,} samples": (lambda: model.torque(*many), SAMPLES),
    }
    compiler = c_compiler()
    return ways | _c_ways(model, folder, compiler, one) if compiler else ways


def measured(ways: dict[str, tuple[Callable[[], object], int]]) -> dict[str, float]:
    """Median processor time of each way for one state [µs]."""
    times: dict[str, list[float]] = {name: [] for name in ways}
    for work, _ in ways.values():
        work()
    for _ in range(TURNS):
        for name, (work, states) in ways.items():
            begin = time.process_time()
            work()
            times[name].append((time.process_time() - begin) / states * 1e6)
    return {name: float(np.median(each)) for name, each in times.items()}


def _repeated(call: Callable[[], object], times: int) -> Callable[[], None]:
    def work() -> None:
        for _ in range(times):
            call()

    return work


def _c_ways(model, folder: Path, compiler: str, one: np.ndarray) -> dict:
    """The exported function, called from a loop in C and from Python."""
    exported = to_c(model, "arm")
    (folder / "arm.c").write_bytes(exported.content)
    (folder / "arm.h").write_bytes(exported.further["arm.h"])
    (folder / "loop.c").write_text(C_LOOP)
    flags = ["-std=c99", "-O3", "-march=native", "-fPIC", "-shared"]
    sources = [str(folder / "arm.c"), str(folder / "loop.c")]
    subprocess.run([compiler, *flags, "-o", str(folder / "arm.so"), *sources, "-lm"], check=True)
    library, tau = ctypes.CDLL(str(folder / "arm.so")), np.zeros(one.shape[1])
    pointer = ctypes.POINTER(ctypes.c_double)
    places = [x.ctypes.data_as(pointer) for x in (*one, tau)]
    single = library.arm_inverse_dynamics
    many = 200 * CALLS
    return {
        "C, from C": (lambda: library.loop(ctypes.c_size_t(many), *places), many),
        "C, from Python by ctypes": (_repeated(lambda: single(*places), CALLS), CALLS),
    }


if __name__ == "__main__":
    main()
