"""The league: every method on simulated records whose truth is known, and its table for the docs.

    python benchmarks/league.py OUT [--runs 130] [--scenarios birdy,fine] [--minutes 100]

Resumable: the folder holds a study for each condition. Runs are added evenly over all conditions
until each has so many, or the minutes are over. Conditions of BIRDy's that differ in the decimation
alone differ for methods that decimate alone; all others run on the first of the two only, and the
table shows them there. ``--table FILE`` writes what is there and computes nothing; rows of FILE of
other conditions and methods stay, so that quick methods may have more runs than slow ones.
"""

from __future__ import annotations

import argparse
import csv
import math
import time
from collections.abc import Iterator
from pathlib import Path

from pivident.estimation.literature.filters.state_filter import StateFilter
from pivident.estimation.method import Method
from pivident.estimation.methods import METHODS
from pivident.estimation.signal_recipes import Decimated
from pivident.studies.many.batch.runner import Processes
from pivident.studies.many.study.conclusion import conclude_study, write_index
from pivident.studies.many.study.run import Store, run_study
from pivident.studies.many.study.scenario import Scenario, load_scenario
from pivident.studies.many.study.summary import MethodSummary, Summary

#: Methods of the league. Filters by sigma points and the linear programs of set membership, which
#: take as long as all others together, run in a league of their own, and so would particles.
QUICK = ("all", "-particle", "-ukf", "-cdkf", "-set-membership")

#: Runs that are added to a condition at a time.
AT_A_TIME = 26

COLUMNS = (
    "scenario", "condition", "method", "runs", "error", "d_beta", "d_beta_of_mean", "d_tau",
    "d_tau_of_mean", "coverage", "coverage_low", "coverage_high", "seconds", "simulations",
    "failed", "not_converged", "not_simulated",
)  # fmt: skip


def conditions(names: list[str], methods: list[str]) -> Iterator[Scenario]:
    """Conditions of scenarios, each with the methods that it says something about."""
    for name in names:
        scenario = load_scenario(name).with_methods(methods)
        for condition in scenario.conditions:
            if not condition.condition.endswith("-d4"):
                yield condition
            elif thinning := [m for m in condition.methods if thins(METHODS[m])]:
                yield condition.with_methods(thinning)


def thins(method: Method) -> bool:
    """Whether a method solves equations that are decimated; filters only start from them."""
    return isinstance(method.signals, Decimated) and not isinstance(method, StateFilter)


def place(folder: Path, condition: Scenario) -> Path:
    """Folder of a condition."""
    return folder / condition.name / (condition.condition or "all")


def compute(folder: Path, chosen: list[Scenario], runs: int, minutes: float, workers: int) -> None:
    """Add runs evenly until there are enough, or time is over."""
    end = time.monotonic() + 60.0 * minutes
    for total in range(AT_A_TIME, runs + AT_A_TIME, AT_A_TIME):
        for condition in chosen:
            if time.monotonic() > end:
                return
            many = min(total, runs)
            if len(done(folder, condition)) < many:
                run_study(
                    condition, place(folder, condition), many, pool=Processes(workers), say=print
                )


def done(folder: Path, condition: Scenario) -> set[int]:
    """Runs that are there."""
    own = place(folder, condition)
    return Store(own).done() if own.is_dir() else set()


def row(summary: Summary, method: str, m: MethodSummary) -> dict[str, object]:
    """A line of the table."""
    scenario, _, condition = summary.scenario.partition("/")
    low, high = m.coverage_interval
    mean = m.merit_of_mean
    values: dict[str, object] = {
        "scenario": scenario, "condition": condition, "method": method, "runs": m.runs + m.failed,
        "error": m.median_relative_error, "d_beta": m.merit.d_beta, "d_tau": m.merit.d_tau,
        "d_beta_of_mean": mean.d_beta if mean else math.nan,
        "d_tau_of_mean": mean.d_tau if mean else math.nan,
        "coverage": m.coverage, "coverage_low": low, "coverage_high": high, "seconds": m.seconds,
        "simulations": m.simulations, "failed": m.failed, "not_converged": m.not_converged,
        "not_simulated": m.simulations_diverged,
    }  # fmt: skip
    return {k: f"{v:.4g}" if isinstance(v, float) else v for k, v in values.items()}


def main() -> None:
    """Run as a script."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path)
    parser.add_argument("--runs", type=int, default=130)
    parser.add_argument("--minutes", type=float, default=math.inf)
    parser.add_argument("--scenarios", default="birdy,fine,loop,coarse")
    parser.add_argument("--methods", default=",".join(QUICK))
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--table", type=Path)
    chosen = parser.parse_args()
    cases = list(conditions(chosen.scenarios.split(","), chosen.methods.split(",")))
    if chosen.table is None:
        compute(chosen.out, cases, chosen.runs, chosen.minutes, chosen.workers)
    summaries: dict[str, dict[str, Summary]] = {}
    for condition in cases:
        if done(chosen.out, condition):
            made = conclude_study(condition, place(chosen.out, condition))
            summaries.setdefault(condition.name, {})[condition.condition] = made
    for name, own in summaries.items():
        write_index(own, chosen.out / name)
    target = chosen.table or chosen.out / "league.csv"
    made = [
        row(summary, name, m)
        for own in summaries.values()
        for summary in own.values()
        for name, m in summary.methods.items()
    ]
    write(target, made)
    print(target)


def write(target: Path, made: list[dict[str, object]]) -> None:
    """Rows into a table: in place of its own of the same condition and method, or behind them."""
    kept: dict[tuple[object, ...], dict[str, object]] = {}
    if target.exists():
        with target.open(newline="") as file:
            for old in csv.DictReader(file):
                kept[tuple(old[key] for key in COLUMNS[:3])] = dict(old)
    for new in made:
        kept[tuple(new[key] for key in COLUMNS[:3])] = new
    with target.open("w", newline="") as file:
        table = csv.DictWriter(file, COLUMNS, lineterminator="\n")
        table.writeheader()
        table.writerows(kept.values())


if __name__ == "__main__":
    main()
