"""One identification in a process of its own: time and peak memory as JSON.

python -m speed.child '{"samples": 100000, "method": "piv"}'
"""

from __future__ import annotations

import json
import resource
import sys
import time


def main() -> None:
    """Read what is wanted from the command line, print the figures."""
    wanted = json.loads(sys.argv[1])
    import numpy as np

    from pivident.estimation.identify import identify

    from .workloads import simulated_record

    warm = simulated_record(8000, wanted.get("parameters", 28))
    identify(warm, wanted["method"])
    problem = simulated_record(wanted["samples"], wanted.get("parameters", 28))
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    wall, cpu = [], []
    for _ in range(wanted.get("repeats", 1)):
        started, ticks = time.perf_counter(), time.process_time()
        found = identify(problem, wanted["method"])
        wall.append(time.perf_counter() - started)
        cpu.append(time.process_time() - ticks)
    raw = sum(r.q.nbytes + r.tau.nbytes for r in problem.recordings)
    print(
        json.dumps(
            {
                "seconds": float(np.median(wall)),
                "cpu_seconds": float(np.median(cpu)),
                "iterations": found.iterations,
                "peak_mib": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
                "before_mib": before,
                "raw_mib": raw / 2**20,
            }
        )
    )


if __name__ == "__main__":
    main()
