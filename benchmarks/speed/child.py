"""One identification in a process of its own: time and peak memory as JSON.

python -m speed.child '{"samples": 100000, "method": "piv"}'
"""

from __future__ import annotations

import gc
import json
import sys
import time
from dataclasses import replace
from pathlib import Path

_PROCESS = Path("/proc/self")


def main() -> None:
    """Read what is wanted from the command line, print the figures."""
    wanted = json.loads(sys.argv[1])
    import numpy as np

    from pivident.estimation.identify import identify
    from pivident.estimation.prefiltered_iv import PrefilteredIV
    from pivident.experiment import simulated_tx40 as scenarios

    from .workloads import simulated_record

    warm = simulated_record(8000, wanted.get("parameters", 28))
    method = wanted["method"]
    if wanted.get("iterations"):  # the same work at each length
        method = PrefilteredIV(max_iterations=wanted["iterations"], tolerance=1e-12)
    identify(warm, method)
    problem = simulated_record(wanted["samples"], wanted.get("parameters", 28))
    # a log has positions, torques and references; a simulation knows their derivatives too
    logged = replace(problem.recordings[0], dq_ref=None, ddq_ref=None)
    problem = replace(problem, recordings=(logged,))
    simulated_record.cache_clear()
    scenarios.tx40_reference.cache_clear()
    gc.collect()
    before = _forget_peak()
    wall, cpu = [], []
    for _ in range(wanted.get("repeats", 1)):
        started, ticks = time.perf_counter(), time.process_time()
        found = identify(problem, method)
        wall.append(time.perf_counter() - started)
        cpu.append(time.process_time() - ticks)
    raw = sum(r.q.nbytes + r.tau.nbytes for r in problem.recordings)
    print(
        json.dumps(
            {
                "seconds": float(np.median(wall)),
                "cpu_seconds": float(np.median(cpu)),
                "iterations": found.iterations,
                "peak_mib": _memory("VmHWM"),
                "before_mib": before,
                "raw_mib": raw / 2**20,
            }
        )
    )


def _memory(entry: str) -> float:
    """An entry of the process's memory, VmRSS (now) or VmHWM (most) [MiB]; NaN: no Linux."""
    try:
        lines = (_PROCESS / "status").read_text().splitlines()
    except OSError:
        return float("nan")
    return next(int(line.split()[1]) / 1024 for line in lines if line.startswith(entry))


def _forget_peak() -> float:
    """Count the most memory from now on, which leaves out the making of the record [MiB now]."""
    if (_PROCESS / "clear_refs").exists():
        (_PROCESS / "clear_refs").write_text("5")
    return _memory("VmRSS")


if __name__ == "__main__":
    main()
