"""Where commands with many tasks compute them: processes here, or a Dask cluster."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pivident.foundation.errors import ExperimentError

if TYPE_CHECKING:
    from pivident.studies.many.batch.runner import Pool


def chosen_pool(workers: int | None, dask: bool, scheduler: str | None) -> Pool:
    """The workers that the options ask for."""
    from pivident.studies.many.batch.cluster import DaskCluster
    from pivident.studies.many.batch.runner import Processes

    check_count("--workers", workers)
    if scheduler is not None and workers is not None:
        raise ExperimentError(
            "--scheduler uses the workers of its cluster",
            advice="leave --workers out, or --scheduler",
        )
    if dask or scheduler is not None:
        return DaskCluster(scheduler, workers)
    return Processes(workers)


def check_count(option: str, value: int | None) -> None:
    """Refuse a number below one."""
    if value is not None and value < 1:
        raise ExperimentError(f"{option} is {value}", advice="at least 1 is needed")
