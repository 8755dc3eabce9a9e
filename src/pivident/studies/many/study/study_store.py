"""Results of a study on disk: one row per run and method; see `batch.results_folder`."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from pivident.foundation.extras import require
from pivident.studies.many.batch.batch_errors import OtherScenario, StudyFolderError
from pivident.studies.many.batch.results_folder import MANIFEST as MANIFEST
from pivident.studies.many.batch.results_folder import UNFINISHED as UNFINISHED
from pivident.studies.many.batch.results_folder import ResultsFolder, Row

if TYPE_CHECKING:
    import polars as pl

    from pivident.studies.many.study.scenario import Scenario


def row_schema() -> dict[str, Any]:
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


class Store(ResultsFolder):
    """The results folder of one scenario, or of one condition of it."""

    shards_name, owner, work, rows_name = "runs", "scenario", "study", "runs"
    error, other = StudyFolderError, OtherScenario

    def schema(self) -> dict[str, Any]:
        """Columns of a shard."""
        return row_schema()

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
            "methods": {name: _options(m) for name, m in scenario.methods.items()},
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


def _options(method: Any) -> dict[str, Any]:
    return json.loads(json.dumps(dataclasses.asdict(method), default=str))
