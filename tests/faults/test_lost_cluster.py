"""A Dask cluster that has lost all of its workers is noticed, not waited for."""

from concurrent.futures.process import BrokenProcessPool

import pytest

from pivident.studies.many.batch import cluster
from pivident.studies.many.batch.batch_errors import BatchError
from pivident.studies.many.batch.cluster import DaskCluster


class Connection:
    """A client that sees so many workers."""

    def __init__(self, workers):
        self.workers = workers

    def scheduler_info(self):
        return {"workers": {str(k): {} for k in range(self.workers)}}


@pytest.mark.parametrize(
    ("scheduler", "error"), [(None, BrokenProcessPool), ("tcp://nobody:8786", BatchError)]
)
def test_no_workers_for_long(monkeypatch, scheduler, error):
    pool = DaskCluster(scheduler, 1)
    pool.check()  # before there is a cluster
    pool._connection = Connection(0)
    pool.check()  # one may be starting
    monkeypatch.setattr(cluster, "FIRST_WORKER", 0)
    with pytest.raises(error):
        pool.check()
    pool._connection = Connection(2)
    pool.check()
