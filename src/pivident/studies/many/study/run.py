"""Runs of a study: simulate a record, identify it with every method, one row for each.

A failed run has a row too: error class and message in place of estimates.
They are computed on any executor and written once; see `batch.runner`.

Results of a study on disk: one row per run and method; see `batch.results_folder`.
"""

from __future__ import annotations

import dataclasses
import json
import pickle
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import Executor
from contextlib import contextmanager
from dataclasses import dataclass
from functools import lru_cache, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pivident.estimation.identification import Identification
from pivident.foundation.common_work import shared_work
from pivident.foundation.extras import require
from pivident.foundation.progress import Say
from pivident.judgement.diagnostics.failed_simulation import explained_identify
from pivident.judgement.validation.residuals.autocorrelation import correlated_shares
from pivident.loop.simulation.excitation import FourierSeries
from pivident.studies.many.batch.batch_errors import OtherScenario, StudyFolderError
from pivident.studies.many.batch.results_folder import (
    MANIFEST as MANIFEST,
    UNFINISHED as UNFINISHED,
    ResultsFolder,
    Row as Row,
    failure,
)
from pivident.studies.many.batch.runner import CHANGED, Pool, Runner, in_one_thread, pool_of
from pivident.studies.many.study.bench import Bench
from pivident.studies.many.study.scenario import Scenario
from pivident.studies.many.study.scenario_tables import (
    FILE as TRAJECTORY,
    as_json,
    optimised_series,
)
from pivident.studies.many.study.summary import figures_of_merit

if TYPE_CHECKING:
    import polars as pl


@dataclass(frozen=True)
class Task:
    """The data of a scenario for a worker; small, and the same for all runs."""

    key: str  # hash of the scenario
    payload: bytes  # scenario, robot and motion, pickled

    @classmethod
    def of(cls, scenario: Scenario, series: FourierSeries | None) -> Task:
        """The task of a scenario."""
        parts = (scenario.name, scenario.plain, scenario.source, scenario.condition)
        return cls(scenario.hash, pickle.dumps((parts, scenario.robot, series)))


@lru_cache(maxsize=1)
def _bench(task: Task) -> Bench:
    """The bench, made once per process: robot, motion and truth are the same for all runs."""
    (name, plain, source, condition), robot, series = pickle.loads(task.payload)
    scenario = Scenario(name, plain, source, {}, condition)
    vars(scenario)["robot"] = robot  # its file need not be where the worker is
    return Bench(scenario, series)


def execute(task: Task, run: int) -> list[Row]:
    """All rows of a run, one per method."""
    bench = _bench(task)
    common: Row = {"run": run, "record": bench.record_of(run), "start": bench.start_of(run)}
    begin = time.perf_counter()
    try:
        problem = bench.problem(run)
    except Exception as error:
        failed = failure(error, time.perf_counter() - begin)
        return [common | {"method": method} | failed for method in bench.scenario.methods]
    rows = []
    with shared_work() as shared:
        for name, method in bench.scenario.methods.items():
            # as if the method stood alone: what was reused began to run before
            begin, saved = time.perf_counter(), shared.saved
            try:
                found = explained_identify(problem, method, test_gains=False)
                answer = _values(bench, found, begin - (shared.saved - saved))
            except Exception as error:
                answer = failure(error, time.perf_counter() - begin + shared.saved - saved)
            rows.append(common | {"method": name} | answer)
    return rows


def _values(bench: Bench, found: Identification, begin: float) -> Row:
    """The row of an identification."""
    seconds = time.perf_counter() - begin
    merit = figures_of_merit(bench, found.theta)
    return {
        "converged": bool(found.converged),
        "iterations": found.iterations,
        "simulations": found.simulations,
        "theta": found.theta.tolist(),
        "std": found.method_std.tolist(),
        "robust_std": found.robust_std.tolist(),
        "formula_std": found.formula_std.tolist(),
        "relative_error": found.relative_error,
        "condition": found.condition,
        "d_tau": merit.d_tau,
        "d_q": merit.d_q if np.isfinite(merit.d_q) else None,
        "d_beta": merit.d_beta,
        "seconds": seconds,
        "noise_order": [fit.ar_order for fit in found.joints],
        "correlated": correlated_shares(found),
    }


def lost_rows(task: Task, run: int, times: int) -> list[Row]:
    """Rows of a run whose worker died each time it was tried."""
    bench = _bench(task)
    common: Row = {"run": run, "record": bench.record_of(run), "start": bench.start_of(run)}
    message = f"the worker died {times} times on this run; is there enough memory?"
    lost: Row = {"error": "WorkerLost", "message": message}
    return [common | {"method": method} | lost for method in bench.scenario.methods]


def run_study(
    scenario: Scenario,
    folder: str | Path,
    runs: int | None = None,
    *,
    workers: int | None = None,
    executor: Executor | None = None,
    pool: Pool | None = None,
    say: Say | None = None,
) -> Store:
    """Compute the runs of a scenario that are not in the folder yet.

    Args:
        scenario: a scenario without conditions, or one condition.
        folder: results folder; new, or of the same scenario.
        runs: total number of runs; None: that of the scenario.
        workers: processes on this machine, or runs at a time of ``executor``.
        executor: any executor whose workers can import pivident.
        pool: instead of the two, see ``cluster``.
        say: progress.

    Returns:
        The folder with all runs.

    Raises:
        StudyFolderError: the folder cannot be used; it is not changed.
        ExperimentError: the scenario contradicts itself.
    """
    say = say or (lambda line: None)
    total = scenario.content.runs if runs is None else runs
    if runs is not None and runs != scenario.content.runs:
        scenario = scenario.with_runs(total)
    pool = pool or pool_of(workers, executor)
    store = Store(Path(folder))
    with store.opened(scenario, total):
        series = optimised_series(scenario, store.folder, say)
        if series is not None and not (store.folder / TRAJECTORY).is_file():
            store.write(TRAJECTORY, as_json(scenario, series))
        done = store.done()
        missing = [run for run in range(total) if run not in done]
        if done and missing and len(store.programs()) > 1:
            say(f"{scenario.title}: {CHANGED}")
        if done and missing:
            say(f"{scenario.title}: {total - len(missing)} runs are done, {len(missing)} to do")
        work = execute if executor is not None else partial(in_one_thread, execute)
        if missing:
            task = Task.of(scenario, series)
            Runner(task, store, pool, work, lost_rows, scenario.title, total, say).compute(missing)
    return store


class Store(ResultsFolder):
    """The results folder of one scenario, or of one condition of it."""

    shards_name, owner, work, rows_name = "runs", "scenario", "study", "runs"
    error, other = StudyFolderError, OtherScenario

    def schema(self) -> dict[str, Any]:
        """Columns of a shard."""
        pl = require("polars", extra="tables", purpose="a Monte Carlo study")
        numbers, text = pl.List(pl.Float64), pl.String
        return {
            "run": pl.Int64,
            "record": pl.Int64,
            "start": pl.Int64,
            "method": text,
            "converged": pl.Boolean,
            "iterations": pl.Int64,
            "simulations": pl.Int64,
            "theta": numbers,
            "std": numbers,
            "robust_std": numbers,
            "formula_std": numbers,
            "relative_error": pl.Float64,
            "condition": pl.Float64,
            "d_tau": pl.Float64,
            "d_q": pl.Float64,
            "d_beta": pl.Float64,
            "seconds": pl.Float64,
            "noise_order": pl.List(pl.Int64),  # of each joint's noise model, zero without one
            # share of each joint's autocorrelations beyond ±2/√n, of white noise 0.05
            "correlated": numbers,
            "error": text,
            "message": text,
        }

    @contextmanager
    def opened(self, scenario: Scenario, runs: int) -> Iterator[Store]:
        """Lock the folder for a study, after creating it or checking that it belongs to it."""
        present = (self.manifest() or {}).get("runs", 0) if self.folder.is_dir() else 0
        wanted = {
            "name": scenario.title,
            "description": scenario.content.description,
            "hash": scenario.hash,
            "scenario": scenario.identity,
            "seed": scenario.content.seed,
            "methods": {
                name: json.loads(json.dumps(dataclasses.asdict(method), default=str))
                for name, method in scenario.methods.items()
            },
            "runs": max(runs, present),
        }
        with self.taken(wanted):
            yield self

    def rows(self) -> pl.DataFrame:
        """All rows, sorted by run and method; each run once."""
        # two studies cannot write at once, so a run occurs twice only if a shard was copied
        return self.read().unique(["run", "method"], keep="first").sort("run", "method")

    def done(self) -> set[int]:
        """Numbers of the runs that are on disk."""
        return set(self.read(["run"])["run"].to_list())

    def shard_name(self, rows: Sequence[Row]) -> str:
        """The runs in it."""
        runs = [row["run"] for row in rows]
        return f"{min(runs):08d}-{max(runs):08d}"

    def manifest_kinds(self) -> dict[str, type]:
        """The number of runs is read back."""
        return {"runs": int}
