"""The same numbers for any number of workers, and nothing lost when some of them are killed."""

import multiprocessing
import os
import signal
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from pivident.foundation.errors import ExperimentError
from pivident.studies.many.batch import runner
from pivident.studies.many.batch.batch_errors import SchedulerUnreachable
from pivident.studies.many.batch.cluster import DaskCluster
from pivident.studies.many.batch.runner import Processes
from pivident.studies.many.study import run
from pivident.studies.many.study.run import Row, Store, Task, execute, run_study
from tests.studies.many.study.small import TEXT, small

RUNS = 12

#: Columns that do not depend on how busy the machine is.
NUMBERS = """
run record start method theta std robust_std formula_std iterations converged relative_error
d_tau d_q d_beta error
""".split()


@pytest.fixture(scope="module")
def reference(tmp_path_factory):
    """The runs, one after the other in this process."""
    with ThreadPoolExecutor(1) as executor:
        store = run_study(
            small(), tmp_path_factory.mktemp("serial"), RUNS, executor=executor, workers=1
        )
    return store.rows().select(NUMBERS)


def same(store: Store, reference) -> None:
    rows = store.rows()
    assert rows["run"].to_list() == [k for k in range(RUNS) for _ in range(2)]
    assert rows.select(NUMBERS).equals(reference)  # bit for bit
    written = sum(len(_runs_of(shard)) for shard in store.shards.glob("*.parquet"))
    assert written == RUNS  # in the files, too, each run is there once


def _runs_of(shard: Path) -> set[int]:
    import polars as pl

    return set(pl.read_parquet(shard, columns=["run"])["run"].to_list())


def test_the_reference_is_no_set_of_failures(reference):
    assert reference["error"].null_count() == 2 * RUNS
    assert np.array(reference["theta"].to_list()).std(axis=0).min() > 0


def test_only_missing_runs_are_computed(reference, tmp_path, monkeypatch):
    computed = []

    def counting(task: Task, run: int) -> list[Row]:
        computed.append(run)
        return execute(task, run)

    monkeypatch.setattr(run, "execute", counting)
    with ThreadPoolExecutor(2) as executor:
        run_study(small(), tmp_path, 5, executor=executor)
        store = run_study(small(), tmp_path, RUNS, executor=executor)
        run_study(small(), tmp_path, 3, executor=executor)
    assert sorted(computed) == list(range(RUNS))
    same(store, reference)


def test_a_local_dask_cluster_gives_the_same_numbers_even_if_its_workers_die_at_the_start(
    reference, tmp_path, monkeypatch
):
    distributed = pytest.importorskip("distributed")
    started = []

    class Unlucky(distributed.LocalCluster):
        def __init__(self, **options):
            started.append(len(started))
            if len(started) < 3:
                raise RuntimeError("Nanny failed to start.")
            super().__init__(**options)

    monkeypatch.setattr(distributed, "LocalCluster", Unlucky)
    same(run_study(small(), tmp_path, RUNS, pool=DaskCluster(workers=2)), reference)
    assert started == [0, 1, 2]


def test_two_processes_give_the_same_numbers_even_if_one_is_killed(
    reference, tmp_path, monkeypatch
):
    monkeypatch.setattr(runner, "REPORT_PERIOD", 0.05)
    monkeypatch.setattr(runner, "PORTION", 1)
    killed, said = [], []

    def say(line: str) -> None:
        said.append(line)
        if " of " in line and not line.startswith("small: 0 ") and not killed:
            victim = multiprocessing.active_children()[0]
            os.kill(victim.pid, signal.SIGKILL)
            killed.append(victim.pid)

    same(run_study(small(), tmp_path, RUNS, workers=2, say=say), reference)
    assert killed and "small: a worker has died; its runs are computed again" in said
    assert said[-1].startswith(f"small: {RUNS} of {RUNS} runs")
    assert not multiprocessing.active_children()


def test_a_killed_study_goes_on_where_it_was(reference, tmp_path):
    """SIGKILL in the middle: what is on disk stays, and the rest is computed."""
    folder = tmp_path / "out"
    code = f"""
from pivident.studies.many.batch import runner
from pivident.studies.many.study import run
from pivident.studies.many.study.scenario import read_scenario
runner.PORTION = 1
if __name__ == "__main__":
    run.run_study(read_scenario({TEXT!r}, "small"), {str(folder)!r}, {RUNS}, workers=1)
"""
    script = tmp_path / "study.py"
    script.write_text(code)
    process = subprocess.Popen([sys.executable, str(script)], stderr=subprocess.PIPE)
    limit = time.monotonic() + 120
    while len(list(folder.glob("runs/*.parquet"))) < 2 and time.monotonic() < limit:
        assert process.poll() is None, process.stderr.read()
        time.sleep(0.005)
    process.kill()
    process.wait()
    done = Store(folder).done()
    assert 2 <= len(done) < RUNS
    with ThreadPoolExecutor(1) as executor:
        same(run_study(small(), folder, RUNS, executor=executor), reference)


class Fragile:
    """An executor whose pool breaks whenever a certain run is submitted."""

    workers = 2

    def __init__(self, poison: int) -> None:
        self.poison = poison

    @contextmanager
    def __call__(self):
        from concurrent.futures import Future
        from concurrent.futures.process import BrokenProcessPool

        broken = []

        class Pool:
            def submit(pool, work, task, run):
                future = Future()
                if broken or run == self.poison:
                    broken.append(run)
                    future.set_exception(BrokenProcessPool("a worker died"))
                else:
                    future.set_result(execute(task, run))
                return future

        yield Pool()


def test_a_run_that_kills_its_workers_is_recorded_and_the_others_go_on(reference, tmp_path):
    store = run_study(small(), tmp_path, RUNS, pool=Fragile(poison=4))
    rows = store.rows().select(NUMBERS)
    lost = rows.filter(rows["run"] == 4)
    assert lost["error"].to_list() == ["WorkerLost", "WorkerLost"]
    assert rows.filter(rows["run"] != 4).equals(reference.filter(reference["run"] != 4))


def test_a_failing_run_is_a_row(tmp_path):
    soft = small(controller={"drive_gain": [-1, 1]})
    with ThreadPoolExecutor(1) as executor:
        rows = run_study(soft, tmp_path, 2, executor=executor).rows()
    assert rows["error"].to_list() == ["SimulationDiverged"] * 4
    assert "shoulder" in rows["message"][0]
    assert rows["theta"].null_count() == 4


@pytest.mark.parametrize("cluster", [False, True], ids=["processes", "dask"])
def test_failing_runs_come_back_from_other_processes(cluster, tmp_path):
    """Their errors hold arrays and problems, which have to reach this process or be left behind."""
    if cluster:
        pytest.importorskip("distributed")
    pool = DaskCluster(workers=1) if cluster else Processes(1)
    soft = small(controller={"drive_gain": [-1, 1]})
    rows = run_study(soft, tmp_path, 2, pool=pool).rows()
    assert rows["error"].to_list() == ["SimulationDiverged"] * 4
    assert all("'shoulder'" in message for message in rows["message"])


def test_a_method_that_fails_leaves_the_others_their_rows(tmp_path):
    early = small(identify={"methods": ["ls", "iv"], "iv": {"bandpass": {"cutoff": 400.0}}})
    with ThreadPoolExecutor(1) as executor:
        rows = run_study(early, tmp_path, 1, executor=executor).rows()
    by_method = dict(zip(rows["method"], rows["error"], strict=True))
    assert by_method["ls"] is None and by_method["iv"] is not None


def test_an_error_of_the_disk_ends_the_study_with_its_name(tmp_path, monkeypatch):
    from pivident.studies.many.batch.batch_errors import StudyFolderError

    monkeypatch.setattr(runner, "PORTION", 1)

    def full(self, rows):
        raise StudyFolderError(self.folder, "cannot be written to (No space left)", "free some")

    monkeypatch.setattr(Store, "append", full)
    with ThreadPoolExecutor(1) as executor, pytest.raises(StudyFolderError, match="No space"):
        run_study(small(), tmp_path, 4, executor=executor)


def test_an_interrupted_study_keeps_what_has_finished(tmp_path, monkeypatch, reference):
    monkeypatch.setattr(runner, "REPORT_PERIOD", 0.01)

    def say(line: str) -> None:
        if " of " in line and not line.startswith("small: 0 "):
            raise KeyboardInterrupt

    with ThreadPoolExecutor(1) as executor:
        with pytest.raises(KeyboardInterrupt):
            run_study(small(), tmp_path, RUNS, executor=executor, workers=1, say=say)
        assert 0 < len(Store(tmp_path).done()) < RUNS
        same(run_study(small(), tmp_path, RUNS, executor=executor), reference)


def test_a_scheduler_that_does_not_answer_is_named(tmp_path, monkeypatch):
    pytest.importorskip("distributed")
    from pivident.studies.many.batch import cluster

    monkeypatch.setattr(cluster, "PATIENCE", 0.5)
    for address in ("tcp://127.0.0.1:1", "nonsense://"):
        with pytest.raises(SchedulerUnreachable, match=address):
            run_study(small(), tmp_path, RUNS, pool=DaskCluster(address))
    assert not Store(tmp_path).done()


def test_workers_take_one_thread_each(monkeypatch):
    monkeypatch.delenv("OPENBLAS_NUM_THREADS")  # the tests' own, see conftest.py
    before = dict(os.environ)
    with Processes(1)():
        assert os.environ["OPENBLAS_NUM_THREADS"] == "1"  # its processes inherit that
    assert dict(os.environ) == before


def test_more_runs_than_there_can_be_are_refused(tmp_path):
    few = small(runs=6, record={"records": 3}, start={"spread": 0.1, "count": 2})
    few.with_runs(6)
    with pytest.raises(ExperimentError, match="would repeat themselves"):
        few.with_runs(7)
