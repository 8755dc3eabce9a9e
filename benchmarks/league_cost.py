"""Processor time of a run of the league with every method but the particle filter.

    python benchmarks/league_cost.py            all conditions of BIRDy's at the full rate
    python benchmarks/league_cost.py tx40-n1-d1

One thread, median of three runs behind a first one that compiles; and what a condition's 1,300 runs
take on two cores.
"""

from __future__ import annotations

import os
import sys
from statistics import median
from time import process_time

from pivident.estimation.identify import identify
from pivident.foundation.common_work import shared_work
from pivident.foundation.errors import PividentError
from pivident.studies.many.study.bench import Bench
from pivident.studies.many.study.scenario import Scenario, load_scenario

METHODS = ["all", "-particle"]

#: The first one compiles and is not counted.
RUNS = (0, 1, 60, 110)

#: Runs of a condition, and cores.
WHOLE, CORES = 1300, 2


def costs(condition: Scenario) -> list[dict[str, float]]:
    """Seconds of each method, and of simulating the record, in every run that counts."""
    bench, found = Bench(condition, None), []
    for run in RUNS:
        begin = process_time()
        problem = bench.problem(run)
        own = {"record": process_time() - begin}
        with shared_work():
            for name, method in condition.methods.items():
                begin = process_time()
                try:
                    identify(problem, method, test_gains=False)
                except PividentError:  # a filter that diverges costs what it took until then
                    pass
                own[name] = process_time() - begin
        found.append(own)
    return found[1:]


def main(names: list[str]) -> None:
    """Print each condition with its slowest methods."""
    os.environ["PIVIDENT_THREADS"] = "1"
    scenario = load_scenario("birdy").with_methods(METHODS)
    for condition in scenario.conditions:
        if condition.condition in names or (not names and condition.condition.endswith("-d1")):
            found = costs(condition)
            whole = median(sum(own.values()) for own in found)
            each = {name: median(own[name] for own in found) for name in found[0]}
            slowest = sorted(each, key=lambda name: -each[name])[:7]
            hours = WHOLE * whole / CORES / 3600.0
            print(
                f"{condition.condition:12s} {whole:5.1f} s a run, {hours:.2f} h a condition;",
                ", ".join(f"{name} {each[name]:.1f}" for name in slowest),
                flush=True,
            )


if __name__ == "__main__":
    main(sys.argv[1:])
