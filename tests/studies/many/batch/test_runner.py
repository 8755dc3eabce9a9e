"""Tasks of any kind: workers that cannot work at all end the matter soon."""

from concurrent.futures import Future
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager

import pytest

from pivident.studies.many.batch.batch_errors import BatchError
from pivident.studies.many.batch.results_folder import ResultsFolder
from pivident.studies.many.batch.runner import MAX_DEATHS, Runner


class Squares(ResultsFolder):
    owner, work, rows_name = "numbers", "test", "squares"

    def schema(self):
        import polars as pl

        return {"number": pl.Int64, "square": pl.Int64, "error": pl.String}


class Breaking:
    """A pool that breaks whenever one of certain numbers is submitted."""

    workers = 2

    def __init__(self, bad):
        self.bad, self.made = bad, 0

    @contextmanager
    def __call__(self):
        self.made += 1
        broken = []

        class Pool:
            def submit(pool, work, task, key):
                future = Future()
                if broken or key in self.bad:
                    broken.append(key)
                    future.set_exception(BrokenProcessPool("a worker died"))
                else:
                    future.set_result(work(task, key))
                return future

        yield Pool()


def square(task, key):
    return [{"number": key, "square": key**2}]


def lost(task, key, times):
    return [{"number": key, "error": f"lost {times} times"}]


def run(folder, pool, count):
    store = Squares(folder)
    with store.taken({"hash": "x", "numbers": {}}):
        Runner(None, store, pool, square, lost, "squares", count, lambda line: None).compute(
            range(count)
        )
    return store


def test_tasks_that_kill_their_workers_are_recorded_and_the_others_computed(tmp_path):
    store = run(tmp_path, Breaking({2, 5}), 8)
    rows = {row["number"]: row for row in store.read().iter_rows(named=True)}
    assert len(rows) == len(store.read()) == 8
    assert {k for k, row in rows.items() if row["error"]} == {2, 5}
    assert all(row["square"] == k**2 for k, row in rows.items() if not row["error"])


def test_workers_that_always_die_end_it_and_keep_what_is_there(tmp_path):
    pool = Breaking(set(range(3, 100)))
    with pytest.raises(BatchError, match=f"died {MAX_DEATHS} times in a row.*__main__"):
        run(tmp_path, pool, 100)
    assert pool.made <= MAX_DEATHS + 1
    done = {r["number"]: r["square"] for r in Squares(tmp_path).read().iter_rows(named=True)}
    assert [done[k] for k in range(3)] == [0, 1, 4]
