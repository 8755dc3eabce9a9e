"""Identification of the new and changed logs of a fleet, kept as a row for each parameter.

A failed log has a row too: error class and message in place of estimates.

Results of a fleet on disk, one row per log and parameter; see `batch.results_folder`.
"""

from __future__ import annotations

import pickle
import time
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import Executor
from contextlib import contextmanager
from dataclasses import dataclass
from functools import lru_cache, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pivident.estimation.identification import Identification
from pivident.estimation.problem import Problem
from pivident.foundation.errors import ExperimentError, PividentError
from pivident.foundation.extras import require
from pivident.foundation.progress import Say
from pivident.foundation.text.display import Displayed
from pivident.judgement.diagnostics.failed_simulation import explained_identify
from pivident.studies.many.batch.batch_errors import OtherContents, ResultsFolderError
from pivident.studies.many.batch.results_folder import ResultsFolder, Row, failure
from pivident.studies.many.batch.runner import CHANGED, Pool, Runner, in_one_thread, pool_of
from pivident.studies.many.fleet.logs import FleetLog, TimeAxis, find_logs
from pivident.studies.many.fleet.template import FILE, Template, load_template

if TYPE_CHECKING:
    import polars as pl


#: Friction of a motor that also turns with a second joint.
COUPLED_FRICTION = ("fvm", "fcm")


@dataclass(frozen=True)
class Task:
    """The data of a fleet for a worker; small, and the same for all logs."""

    key: str  # hash of the template
    payload: bytes  # file, tables and robot, pickled

    @classmethod
    def of(cls, template: Template) -> Task:
        """The task of a template."""
        parts = (str(template.path), template.content, template.experiment.robot)
        return cls(template.hash, pickle.dumps(parts))


@lru_cache(maxsize=1)
def _template(task: Task) -> Template:
    """The template, made once per process: robot and options are the same for all logs."""
    path, content, robot = pickle.loads(task.payload)
    made = Template(Path(path), content)
    vars(made.experiment)["robot"] = robot  # its file need not be where the worker is
    return made


def identify_log(task: Task, log: FleetLog) -> list[Row]:
    """All rows of a log, one for each parameter."""
    begin = time.perf_counter()
    common: Row = {"task": log.name, "sha256": None}
    try:
        template = _template(task)
        common["method"] = template.method_name
        if log.fault:
            raise log.fault
        common["sha256"] = log.digest()
        problem, temperatures = _problem(template, log)
        found = explained_identify(problem, template.method)
    except Exception as error:
        return [common | {"computed": time.time()} | failure(error, time.perf_counter() - begin)]
    common |= {
        "computed": time.time(),
        "converged": bool(found.converged),
        "iterations": found.iterations,
        "samples": sum(r.samples for r in problem.recordings),
        "relative_error": found.relative_error,
        "condition": found.condition,
        "seconds": time.perf_counter() - begin,
    }
    return [common | row for row in _parameters(found, temperatures)]


def lost_log(task: Task, log: FleetLog, times: int) -> list[Row]:
    """The row of a log whose worker died each time; it is retried in the next call."""
    message = f"the worker died {times} times on this log; is there enough memory?"
    common: Row = {"task": log.name, "sha256": None, "method": _template(task).method_name}
    return [common | {"computed": time.time(), "error": "WorkerLost", "message": message}]


def _problem(template: Template, log: FleetLog) -> tuple[Problem, np.ndarray | None]:
    """The problem of a log, and the mean temperature of each joint if the log has it."""
    experiment = template.experiment_of(log)
    recordings = experiment.recordings()
    temperatures = None
    if template.fleet.temperature is not None:
        temperatures = np.concatenate([r.temperature for r in recordings]).mean(axis=0)
    return experiment.problem(recordings=recordings), temperatures


def _parameters(found: Identification, temperatures: np.ndarray | None) -> list[Row]:
    """Names, values and standard errors."""
    names, places = found.robot.tree.joint_names, found.robot.places
    rows: list[dict[str, Any]] = []
    for k, (name, p) in enumerate(zip(found.names, found.parameters, strict=True)):
        dissipates = p.friction is not None and p.friction.is_dissipative
        rows.append(
            {
                "joint": names[p.joint],
                "parameter": name,
                "unit": p.unit,
                "value": float(found.theta[k]),
                "std": float(found.method_std[k]),
                "robust_std": float(found.robust_std[k]),
                "friction": dissipates or p.stem in COUPLED_FRICTION,
                "temperature": None
                if temperatures is None or p.joint not in places
                else float(temperatures[places.index(p.joint)]),
            }
        )
    return rows


class FleetError(PividentError, ValueError):
    """A fleet that cannot be identified or judged."""


class FleetFolderError(ResultsFolderError):
    """A results folder of a fleet that cannot be used or written to."""


class OtherFleet(OtherContents, FleetFolderError):
    """A results folder that holds the results of another fleet."""

    rows, owner = "results", "fleet"


class FleetStore(ResultsFolder):
    """The results folder of a fleet."""

    shards_name, owner, work, rows_name = "logs", "fleet", "fleet", "results"
    error, other = FleetFolderError, OtherFleet

    def schema(self) -> dict[str, Any]:
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


@dataclass(frozen=True, eq=False)
class Fleet(Displayed):
    """The estimates of a fleet.

    Attributes:
        template: its experiment file.
        logs: its logs, in the order of robots and time.
        axis: what their positions in time mean.
        rows: one row for each log and parameter, or with an error; as they are in the store.
        store: the results folder.
    """

    template: Template  # its experiment file
    logs: tuple[FleetLog, ...]  # its logs, in the order of robots and time
    axis: TimeAxis  # meaning of their positions in time
    # one row for each log and parameter, or with an error; as they are in the store
    rows: pl.DataFrame
    store: FleetStore  # the results folder

    @property
    def failures(self) -> pl.DataFrame:
        """Rows of the logs without an estimate."""
        return self.rows.filter(self.rows["error"].is_not_null())

    @property
    def robots(self) -> tuple[str, ...]:
        """Names of all robots."""
        return tuple(dict.fromkeys(log.robot for log in self.logs))


def identify_fleet(
    folder: str | Path,
    experiment: str | Path | Template | None = None,
    out: str | Path | None = None,
    *,
    pool: Pool | None = None,
    workers: int | None = None,
    executor: Executor | None = None,
    say: Say | None = None,
) -> Fleet:
    """Identify every log of a folder that is new or has changed.

    Args:
        folder: folder of the logs.
        experiment: template for all of them; None: ``fleet.toml`` in the folder.
        out: results folder; None: NAME-fleet for the folder NAME.
        pool: workers that identify logs, see `pivident.studies.many.batch.cluster`.
        workers: processes on this machine, or logs at a time of ``executor``.
        executor: any executor whose workers can import pivident and read the logs.
        say: progress.

    Returns:
        The fleet with the estimates of all logs.

    Raises:
        ExperimentError: template, pattern or folder cannot be used.
        FleetFolderError: the results folder cannot be used; it is not changed.
    """
    say = say or (lambda line: None)
    folder = Path(folder)
    template = experiment if isinstance(experiment, Template) else template_of(folder, experiment)
    store = FleetStore(default_out(folder) if out is None else Path(out))
    entry = template.fleet
    try:
        logs, axis = find_logs(
            folder, template.pattern, entry.together, entry.time, without=store.folder
        )
    except ExperimentError as error:
        raise error.headed(f"{template.path}:") from error
    pool = pool or pool_of(workers, executor)
    work = identify_log if executor is not None else partial(in_one_thread, identify_log)
    title = folder.absolute().name or "fleet"
    with store.opened(template):
        known = store.known()
        say(f"{title}: {len(logs)} logs, looking for changes")
        digests = {log.name: _known_digest(log, known) for log in logs}
        missing = [log for log in logs if digests[log.name] is None]
        if known and missing:
            say(f"{title}: {len(logs) - len(missing)} logs are done, {len(missing)} to do")
            if len(store.programs()) > 1:
                say(f"{title}: {CHANGED}")
        if missing:
            Runner(
                Task.of(template), store, pool, work, lost_log, title, len(logs), say, "logs"
            ).compute(missing)
        rows = store.rows(digests)
    return Fleet(template, tuple(logs), axis, rows, store)


def default_out(folder: Path) -> Path:
    """Default results folder."""
    return Path(f"{folder.absolute().name or 'fleet'}-fleet")


def template_of(folder: Path, path: str | Path | None = None) -> Template:
    """The experiment file that is named, or the one in the folder."""
    if path is None and not (folder / FILE).is_file():
        if not folder.is_dir():
            raise ExperimentError(f"{folder} is not a folder", advice="name the folder of the logs")
        raise ExperimentError(
            f"{folder}: there is no {FILE} in it",
            advice="write one, or name an experiment file with --experiment: robot, [recording] "
            "with columns, [controller], and [fleet]",
        )
    return load_template(folder / FILE if path is None else path)


def _known_digest(log: FleetLog, known: dict[str, set[str]]) -> str | None:
    """Hash of a log that was identified with its present content, else None."""
    if log.fault or log.name not in known:
        return None
    try:
        digest = log.digest()
    except (PividentError, OSError):
        return None
    return digest if digest in known[log.name] else None
