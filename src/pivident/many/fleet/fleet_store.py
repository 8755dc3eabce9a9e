"""Results of a fleet on disk, one row per log and parameter; see `batch.results_folder`."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from pivident.errors import PividentError
from pivident.extras import require
from pivident.many.batch.batch_errors import OtherContents, ResultsFolderError
from pivident.many.batch.results_folder import ResultsFolder, Row

if TYPE_CHECKING:
    import polars as pl

    from pivident.many.fleet.template import Template


class FleetError(PividentError):
    """A fleet that cannot be identified or judged."""


class FleetFolderError(ResultsFolderError):
    """A results folder of a fleet that cannot be used or written to."""


class OtherFleet(OtherContents, FleetFolderError):
    """A results folder that holds the results of another fleet."""

    rows, owner = "results", "fleet"


def row_schema() -> dict[str, Any]:
    """Columns of a shard."""
    pl = require("polars", extra="tables", purpose="the study of a fleet")
    text, number = pl.String, pl.Float64
    return {
        "task": text,
        "sha256": text,
        "method": text,
        "computed": number,
        "converged": pl.Boolean,
        "iterations": pl.Int64,
        "samples": pl.Int64,
        "relative_error": number,
        "condition": number,
        "seconds": number,
        "joint": text,
        "parameter": text,
        "unit": text,
        "value": number,
        "std": number,
        "robust_std": number,
        "friction": pl.Boolean,
        "temperature": number,
        "error": text,
        "message": text,
    }


class FleetStore(ResultsFolder):
    """The results folder of a fleet."""

    shards_name, owner, work, rows_name = "logs", "fleet", "fleet", "results"
    error, other = FleetFolderError, OtherFleet

    def schema(self) -> dict[str, Any]:
        """Columns of a shard."""
        return row_schema()

    @contextmanager
    def opened(self, template: Template) -> Iterator[FleetStore]:
        """Lock the folder for a fleet, after creating it or checking that it belongs to it."""
        wanted = {
            "name": template.experiment.title,
            "hash": template.hash,
            "fleet": template.identity,
        }
        with self.taken(wanted):
            yield self

    def known(self) -> dict[str, set[str]]:
        """Hashes of the content of each log at identification."""
        table = self.read(["task", "sha256"]).unique()
        found: dict[str, set[str]] = {}
        for task, digest in table.iter_rows():
            if digest is not None:
                found.setdefault(task, set()).add(digest)
        return found

    def rows(self, digests: Mapping[str, str | None]) -> pl.DataFrame:
        """The rows of logs with the content named by ``digests``; None: the latest of a log."""
        pl = require("polars", extra="tables", purpose="the study of a fleet")
        meant = pl.DataFrame(
            {"task": list(digests), "meant": list(digests.values())},
            schema={"task": pl.String, "meant": pl.String},
        )
        table = self.read().join(meant, on="task", how="inner")
        table = table.filter(
            pl.col("meant").is_null() | (pl.col("sha256").fill_null("") == pl.col("meant"))
        )
        table = table.filter(pl.col("computed") == pl.col("computed").max().over("task"))
        return table.unique(["task", "parameter"], keep="first", maintain_order=True).drop("meant")

    def shard_name(self, rows: Sequence[Row]) -> str:
        """Time of writing."""
        return f"{time.time_ns():020d}"
