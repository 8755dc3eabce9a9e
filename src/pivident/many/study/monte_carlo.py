"""The runs of a study, computed on any executor and written once; see `batch.runner`."""

from __future__ import annotations

from concurrent.futures import Executor
from pathlib import Path

from pivident.many.batch.runner import CHANGED, GivenExecutor, Pool, Processes, Runner, Say
from pivident.many.study.motion import FILE as TRAJECTORY
from pivident.many.study.motion import as_json, optimised_series
from pivident.many.study.run import Task, execute, execute_alone, lost_rows
from pivident.many.study.scenario import Scenario
from pivident.many.study.study_store import Store
from pivident.threads import thread_count


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
    if pool is None:
        at_a_time = workers or thread_count()
        pool = Processes(at_a_time) if executor is None else GivenExecutor(executor, at_a_time)
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
        work = execute if executor is not None else execute_alone
        if missing:
            task = Task.of(scenario, series)
            runner = Runner(task, store, pool, work, lost_rows, scenario.title, total, say)
            runner.compute(missing)
    return store
