"""Errors of batches and of studies; each names the folder or address, and the next step.

Errors of the results folder of a study.
"""

from __future__ import annotations

from collections.abc import Sequence

from pivident.foundation.errors import PividentError


class BatchError(PividentError, RuntimeError):
    """Tasks that cannot be carried out."""


class ResultsFolderError(BatchError):
    """A results folder that cannot be used or written to."""

    def __init__(self, folder: object, problem: str, advice: str) -> None:
        self.folder = str(folder)
        super().__init__(f"{self.folder}: {problem}", advice=advice)


class OtherContents(ResultsFolderError):
    """A results folder with the results of something else; ``differences`` lists the keys."""

    #: What the folder contains, and whose results those are.
    rows, owner = "results", "task"

    def __init__(self, folder: object, differences: Sequence[str]) -> None:
        self.differences = tuple(differences)
        more = f" and {len(self.differences) - 3} more" if len(self.differences) > 3 else ""
        listed = "; ".join(self.differences[:3]) + more
        super().__init__(
            folder,
            f"it contains {self.rows} of another {self.owner} ({listed})",
            f"choose another --out, or run the {self.owner} that the folder belongs to; nothing in "
            "it was changed",
        )


class SchedulerUnreachable(BatchError):
    """A Dask scheduler that does not answer."""

    def __init__(self, address: str, reason: str) -> None:
        self.address = address
        super().__init__(
            f"there is no Dask scheduler at {address} ({reason})",
            advice="start one with 'dask scheduler' and workers with 'dask worker', check the "
            "address (tcp://host:8786), or use --workers on this machine",
        )


class WorkersDiffer(BatchError):
    """Workers of a cluster with another version of pivident."""

    def __init__(self, found: Sequence[str], expected: str) -> None:
        self.found, self.expected = tuple(found), expected
        super().__init__(
            f"the workers have pivident {', '.join(self.found)}, but {expected} is required",
            advice="install the same version on all of them",
        )


class StudyFolderError(ResultsFolderError):
    """A results folder of a study that cannot be used or written to."""


class OtherScenario(OtherContents, StudyFolderError):
    """A results folder that holds the runs of another scenario."""

    rows, owner = "runs", "scenario"
