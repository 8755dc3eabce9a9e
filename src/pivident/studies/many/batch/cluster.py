"""The same tasks on a Dask cluster: of this machine, or of others behind a scheduler."""

from __future__ import annotations

import logging
import os
import time
from collections.abc import Iterator
from concurrent.futures import CancelledError, Executor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from typing import TYPE_CHECKING

from pivident.foundation.extras import require
from pivident.foundation.threads import thread_count
from pivident.studies.many.batch.batch_errors import BatchError, SchedulerUnreachable, WorkersDiffer
from pivident.studies.many.batch.results_folder import fingerprint

if TYPE_CHECKING:
    from distributed import Client, LocalCluster

#: Timeouts of a scheduler's answer and of its first worker [s].
PATIENCE, FIRST_WORKER = 10, 60


#: Dask lets its workers return every freed array to the system, which then clears a new one page by
#: page: a run takes 2.4 times as long. These are the thresholds [bytes] that Linux would reach by
#: itself.
MEMORY = {"MALLOC_TRIM_THRESHOLD_": str(2**26), "MALLOC_MMAP_THRESHOLD_": str(2**25)}


#: Where Dask keeps the environment that its worker processes start in.
SPAWNED = "distributed.nanny.pre-spawn-environ"


class DaskCluster:
    """Workers of a Dask cluster.

    ``scheduler`` is an address, ``tcp://host:8786``; None: a cluster of ``workers`` processes on
    this machine (None: one for each core).
    """

    def __init__(self, scheduler: str | None = None, workers: int | None = None) -> None:
        self.scheduler = scheduler
        self.workers = workers or thread_count()
        self._connection: Client | None = None
        self._last_seen = 0.0

    def check(self) -> None:
        """Detect that all workers are gone: Dask does not restart one that died at its start.

        A cluster on this machine can be restarted (BrokenProcessPool), one behind a scheduler
        cannot (BatchError).
        """
        if self._connection is None or self._connection.scheduler_info().get("workers"):
            self._last_seen = time.monotonic()
            return
        if time.monotonic() - self._last_seen < FIRST_WORKER:
            return
        if self.scheduler is None:
            raise BrokenProcessPool("all workers of the cluster have died")
        raise BatchError(
            f"the scheduler at {self.scheduler} has had no workers for {FIRST_WORKER} s",
            advice="the runs that had finished are on disk. Start some with 'dask worker "
            f"{self.scheduler}', and run the same command to continue",
        )

    @contextmanager
    def __call__(self) -> Iterator[Executor]:
        """An executor on the cluster, disconnected when the context ends."""
        with self._client() as client:
            self._connection, self._last_seen = client, time.monotonic()
            if self.scheduler is not None:
                self.workers = _ready_workers(client, self.scheduler)
            try:
                yield client.get_executor(pure=False)
            except (OSError, CancelledError) as error:
                raise BatchError(
                    f"the connection to the cluster was lost ({str(error) or 'cancelled'})",
                    advice="finished results are on disk; run the same command to continue",
                ) from error

    @contextmanager
    def _client(self) -> Iterator[Client]:
        purpose = "a cluster (--dask or --scheduler; --workers needs none)"
        dask = require("dask", extra="cluster", purpose=purpose)
        distributed = require("distributed", extra="cluster", purpose=purpose)
        logging.getLogger("distributed").setLevel(logging.CRITICAL)  # errors are raised here
        if self.scheduler is None:
            with (
                dask.config.set({f"{SPAWNED}.{key}": value for key, value in MEMORY.items()}),
                _cluster_of_this_machine(distributed.LocalCluster, self.workers) as cluster,
                distributed.Client(cluster) as client,
            ):
                yield client
            return
        try:
            client = distributed.Client(self.scheduler, timeout=PATIENCE)
        except (OSError, ValueError, TimeoutError) as error:
            reason = " ".join(str(error).split()) or type(error).__name__
            raise SchedulerUnreachable(self.scheduler, reason) from error
        with client:
            yield client


def _cluster_of_this_machine(cluster: type[LocalCluster], workers: int) -> LocalCluster:
    """Worker processes and their scheduler."""
    try:
        return cluster(
            n_workers=workers,
            threads_per_worker=1,
            dashboard_address=None,
            silence_logs=50,
            env={"PIVIDENT_THREADS": "1"},
        )
    except RuntimeError as error:
        raise BrokenProcessPool(f"the cluster did not start: {error}") from error


def _ready_workers(client: Client, address: str) -> int:
    """Number of threads of the cluster, after a check of its workers' version."""
    try:
        client.wait_for_workers(1, timeout=FIRST_WORKER)
    except TimeoutError as error:
        raise BatchError(
            f"the scheduler at {address} has no workers",
            advice=f"start some with 'dask worker {address}'",
        ) from error
    try:
        versions = set(client.run(_version).values())
    except (ImportError, AttributeError) as error:
        raise WorkersDiffer(["none that could do this"], fingerprint()) from error
    if versions != {fingerprint()}:
        raise WorkersDiffer(sorted(map(str, versions)), fingerprint())
    return max(1, sum(client.nthreads().values()))


def _version() -> str:
    """Version of pivident on a worker, with its code."""
    os.environ["PIVIDENT_THREADS"] = "1"
    return fingerprint()
