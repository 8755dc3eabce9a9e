"""Processor time of the compiled kernels of this working tree over that of another checkout.

The observation matrix, the simulation in a closed loop and its tangents of the TX40, each with
several laws of friction. One process for each checkout, one thread; they take turns, so that what
else the machine does hits both alike. Each pair gives a ratio; printed are the median of all pairs
and the interval that holds the median with 95 % (order statistics). `compare_speed.py` runs the
benchmarks that each of two trees has; this one the same work on both, law by law.

    python -m benchmarks.kernel_ratios ../other/checkout [--pairs 30]
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from time import process_time

import numpy as np

ROOT = Path(__file__).resolve().parents[1]

#: Friction laws as experiment files have them, by what they are called here.
LAWS = {
    "viscous, Coulomb": '["viscous", "coulomb", "offset"]',
    "Stribeck": '["viscous", "coulomb", {term = "stribeck", speed = 0.1}]',
    "power": '["coulomb", {term = "power", exponent = 0.7}]',
    "LuGre": '["viscous", {term = "lugre", distance = 1e-3, speed = 0.1, excess = 0.5}]',
}

SAMPLES, RATE = 8000, 1000.0


def workloads() -> dict[str, Callable[[], object]]:
    """What is timed, by name; only names are used that both checkouts have."""
    from pivident.dynamics.base_parameters import base_parameters
    from pivident.dynamics.parameters import nominal_values
    from pivident.dynamics.regressor import Regressor
    from pivident.experiment.experiment import load_experiment
    from pivident.loop.simulation.closed_loop import LoopSignals, simulate
    from pivident.loop.simulation.controllers import PD
    from pivident.loop.simulation.direction import Direction, ParametrisedLoop
    from pivident.loop.simulation.reference import point_to_point
    from pivident.loop.simulation.tangents import tangent_blocks

    made: dict[str, Callable[[], object]] = {}
    gains = PD(np.array([12047.5, 12015.0, 4556.8, 1359.0, 2840.3, 2354.1]),
               np.array([89.37, 131.92, 28.23, 4.943, 8.857, 1.282]))  # fmt: skip
    for law, terms in LAWS.items():
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / "experiment.toml"
            names = [f'"{kind}{j}"' for kind in ("q", "u") for j in range(6)]
            columns = f"{{q = [{', '.join(names[:6])}], tau = [{', '.join(names[6:])}]}}"
            text = f'[robot]\nmodel = "staubli_tx40"\nfriction = {terms}\n'
            text += f'[recording]\nfiles = "log.csv"\nrate = 1000.0\ncolumns = {columns}\n'
            file.write_text(text, encoding="utf-8")
            robot = load_experiment(file).robot
        base = base_parameters(robot)
        theta = base.values(nominal_values(robot, base.standard))
        postures = np.random.default_rng(0).uniform(-1.0, 1.0, (6, 6))
        q, dq, ddq = point_to_point(postures, 0.4 * robot.rated_speeds, RATE, SAMPLES)
        whole = np.full(6, np.inf)
        signals = LoopSignals(RATE, q, dq, None, None, np.ones(6), whole, np.ones(6),
                              np.full(6, 100.0))  # fmt: skip
        loop = ParametrisedLoop(robot, base.parameters, theta, gains, signals)
        if law != "LuGre":  # whose columns have memory and need more than the motion
            regressor = Regressor.build(robot, base.parameters)
            made[f"observation matrix, {law}"] = lambda r=regressor, m=(q, dq, ddq): r.matrix(*m)
        made[f"simulation, {law}"] = lambda k=loop: simulate(
            k.model, k.controller, k.signals, k.robot.joint_names
        )
        directions = [Direction("parameter", p.name) for p in base.parameters[:12]]
        made[f"tangents, {law}"] = lambda k=loop, d=directions: list(tangent_blocks(k, d))
    return made


def child() -> None:
    """Time the workload whose name comes on a line, until there are no more lines."""
    every = workloads()
    for run in every.values():
        run()  # compiled, and in the caches
    print(json.dumps(list(every)), flush=True)
    for line in sys.stdin:
        start = process_time()
        every[line.strip()]()
        print(process_time() - start, flush=True)


def started(checkout: Path) -> subprocess.Popen[str]:
    """A child with the package of a checkout."""
    one_thread = dict.fromkeys(
        ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS"), "1"
    )
    environment = os.environ | one_thread | {"PYTHONPATH": str(checkout / "src")}
    command = [sys.executable, __file__, "--child"]
    return subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env=environment
    )


def asked(process: subprocess.Popen[str], name: str) -> float:
    """Processor time of one run in a child [s]."""
    assert process.stdin is not None and process.stdout is not None
    process.stdin.write(f"{name}\n")
    process.stdin.flush()
    return float(process.stdout.readline())


def median_interval(ratios: np.ndarray) -> tuple[float, float, float]:
    """Median, and the order statistics between which it lies with about 95 %."""
    ordered, n = np.sort(ratios), len(ratios)
    half = 0.98 * np.sqrt(n)
    low, high = max(int(np.floor(n / 2 - half)), 0), min(int(np.ceil(n / 2 + half)), n - 1)
    return float(np.median(ratios)), float(ordered[low]), float(ordered[high])


def main() -> None:
    """Print the ratio of every kernel."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("other", type=Path)
    parser.add_argument("--pairs", type=int, default=30)
    options = parser.parse_args()
    here, there = started(ROOT), started(options.other.resolve())
    names: list[str] = []
    for process in (here, there):
        assert process.stdout is not None
        names = json.loads(process.stdout.readline())
    print(f"{options.pairs} alternating pairs, new over old: median (95 %)")
    for name in names:
        ratios = []
        for pair in range(options.pairs):
            order = (here, there) if pair % 2 else (there, here)
            times = {process: asked(process, name) for process in order}
            ratios.append(times[here] / times[there])
        middle, low, high = median_interval(np.array(ratios))
        print(f"{name:40} {middle:.3f} ({low:.3f} to {high:.3f})", flush=True)
    for process in (here, there):
        process.communicate()


if __name__ == "__main__":
    child() if sys.argv[1:] == ["--child"] else main()
