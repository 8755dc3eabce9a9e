"""Throughput of the Monte Carlo laboratory: one process, two processes, a Dask cluster of two.

    python benchmarks/study_throughput.py [--scenario fine] [--runs 200] [--workers 2]

All three must give the same numbers bit for bit. The time of a pool is that of its runs, measured
from the first one that is done, so that starting workers and loading compiled code are not in it.
Memory is that of this process and its workers: after a quarter of the runs, and at the end.
"""

from __future__ import annotations

import argparse
import json
import tempfile
import time
from pathlib import Path

import psutil

from pivident.studies.many.batch.cluster import DaskCluster
from pivident.studies.many.batch.runner import Pool, Processes
from pivident.studies.many.study.run import Store, run_study
from pivident.studies.many.study.scenario import Scenario, load_scenario

#: Columns that must not depend on who computed them.
NUMBERS = ["run", "method", "theta", "std", "robust_std", "iterations", "d_tau", "d_q", "d_beta"]


class Clock:
    """Collects when runs are done, and how much memory they take."""

    def __init__(self, runs: int) -> None:
        self.runs, self.done, self.memory = runs, [], {}

    def __call__(self, line: str) -> None:
        """A line of progress."""
        print(f"  {line}", flush=True)
        words = line.split()
        if "of" in words and words[words.index("of") - 1].isdigit():
            count = int(words[words.index("of") - 1])
            self.done.append((time.perf_counter(), count))
            if count >= self.runs // 4:
                self.memory.setdefault("quarter", tree_memory())
            self.memory["end"] = tree_memory()

    def seconds_per_run(self) -> float:
        """Time from the first line with a finished run to the last one, per run."""
        (begin, first), *_ = [(t, n) for t, n in self.done if n > 0]
        end, last = self.done[-1]
        return (end - begin) / max(last - first, 1)


def tree_memory() -> float:
    """Resident memory of this process and its children [MB]."""
    here = psutil.Process()
    total = 0
    for process in (here, *here.children(recursive=True)):
        try:
            total += process.memory_info().rss
        except psutil.NoSuchProcess:
            continue
    return total / 1e6


def measured(scenario: Scenario, runs: int, pool: Pool, folder: Path) -> tuple[dict, Store]:
    """Figures of one pool."""
    clock = Clock(runs)
    begin = time.perf_counter()
    store = run_study(scenario, folder, runs, pool=pool, say=clock)
    return {
        "seconds": time.perf_counter() - begin,
        "seconds_per_run": clock.seconds_per_run(),
        "memory_quarter_mb": clock.memory.get("quarter"),
        "memory_end_mb": clock.memory.get("end"),
    }, store


def throughput(scenario: Scenario, runs: int, workers: int) -> tuple[dict[str, dict], bool]:
    """One process, several, and a Dask cluster; figures by name, and whether numbers are alike."""
    pools = {
        "1 process": Processes(1),
        f"{workers} processes": Processes(workers),
        f"Dask, {workers} workers": DaskCluster(workers=workers),
    }
    figures, numbers = {}, []
    with tempfile.TemporaryDirectory() as folder:
        for k, (name, pool) in enumerate(pools.items()):
            print(name, flush=True)
            figures[name], store = measured(scenario, runs, pool, Path(folder) / str(k))
            numbers.append(store.rows().select(NUMBERS))
    for f in figures.values():
        f["speed_up"] = figures["1 process"]["seconds_per_run"] / f["seconds_per_run"]
    return figures, all(n.equals(numbers[0]) for n in numbers)


def print_table(figures: dict[str, dict]) -> None:
    """Seconds, ratios and memory of each pool."""
    print(f"{'':20s} {'s/run':>7s} {'speed-up':>8s} {'all [s]':>8s} {'MB, 1/4':>8s} {'at end':>7s}")
    for name, f in figures.items():
        print(
            f"{name:20s} {f['seconds_per_run']:7.3f} {f['speed_up']:8.2f} {f['seconds']:8.1f} "
            f"{f['memory_quarter_mb'] or 0:8.0f} {f['memory_end_mb'] or 0:7.0f}"
        )


def main() -> None:
    """Run the pools, print and write what they took."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--scenario", default="fine")
    parser.add_argument("--runs", type=int, default=200)
    parser.add_argument("--workers", type=int, default=2)
    options = parser.parse_args()
    scenario = load_scenario(options.scenario).conditions[0]
    figures, alike = throughput(scenario, options.runs, options.workers)
    print(f"\n{options.runs} runs of {scenario.title}; the same numbers bit for bit: {alike}")
    print_table(figures)
    target = Path(__file__).parent / "results"
    target.mkdir(exist_ok=True)
    content = {"scenario": scenario.title, "runs": options.runs, "alike": alike} | figures
    (target / "study_throughput.json").write_text(json.dumps(content, indent=1))
    assert alike, "workers have computed different numbers"


if __name__ == "__main__":
    main()
