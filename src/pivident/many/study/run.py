"""One run of a study: simulate its record, identify it with every method, one row for each.

A failed run has a row too: error class and message in place of estimates.
"""

from __future__ import annotations

import os
import pickle
import time
from dataclasses import dataclass

import numpy as np

from pivident.common_work import shared_work
from pivident.estimation.identification import Identification
from pivident.estimation.identify import identify
from pivident.many.batch.failure import failure
from pivident.many.batch.results_folder import Row as Row
from pivident.many.study.bench import Bench
from pivident.many.study.merit import figures_of_merit
from pivident.many.study.scenario import Scenario
from pivident.simulation.excitation import FourierSeries
from pivident.validation.residuals.autocorrelation import correlated_shares

#: The bench that this process used last: robot, motion and truth are the same for all runs.
_last_bench: dict[str, Bench] = {}


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

    @property
    def bench(self) -> Bench:
        """The bench, made once per process."""
        if self.key not in _last_bench:
            (name, plain, source, condition), robot, series = pickle.loads(self.payload)
            scenario = Scenario(name, plain, source, {}, condition)
            vars(scenario)["robot"] = robot  # its file need not be where the worker is
            _last_bench.clear()
            _last_bench[self.key] = Bench(scenario, series)
        return _last_bench[self.key]


def execute(task: Task, run: int) -> list[Row]:
    """All rows of a run, one per method."""
    bench = task.bench
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
                found = identify(problem, method, test_gains=False)
                answer = _values(bench, found, begin - (shared.saved - saved))
            except Exception as error:
                answer = failure(error, time.perf_counter() - begin + shared.saved - saved)
            rows.append(common | {"method": name} | answer)
    return rows


def execute_alone(task: Task, run: int) -> list[Row]:
    """``execute`` in a worker process with one thread: workers share the cores."""
    os.environ["PIVIDENT_THREADS"] = "1"
    return execute(task, run)


def _values(bench: Bench, found: Identification, begin: float) -> Row:
    """The row of an identification."""
    seconds = time.perf_counter() - begin
    merit = figures_of_merit(bench, found.theta)
    return {
        "converged": bool(found.converged),
        "iterations": found.iterations,
        "simulations": found.simulations,
        "theta": found.theta.tolist(),
        "std": found.std.tolist(),
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
    bench = task.bench
    common: Row = {"run": run, "record": bench.record_of(run), "start": bench.start_of(run)}
    message = f"the worker died {times} times on this run; is there enough memory?"
    lost: Row = {"error": "WorkerLost", "message": message}
    return [common | {"method": method} | lost for method in bench.scenario.methods]
