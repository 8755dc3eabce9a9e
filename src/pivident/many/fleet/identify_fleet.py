"""Identification of the new and changed logs of a fleet."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from pivident.errors import ExperimentError, PividentError
from pivident.many.batch.runner import CHANGED, GivenExecutor, Pool, Processes, Runner
from pivident.many.fleet.fleet_store import FleetStore
from pivident.many.fleet.logs import FleetLog, TimeAxis, find_logs
from pivident.many.fleet.one_log import Task, identify_log, identify_log_alone, lost_log
from pivident.many.fleet.template import FILE, Template, load_template
from pivident.threads import thread_count

if TYPE_CHECKING:
    import polars as pl

Say = Callable[[str], None]


@dataclass(frozen=True, eq=False)
class Fleet:
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
        pool: workers that identify logs, see `pivident.many.batch.cluster`.
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
        raise ExperimentError(f"{template.path}: {error}") from error
    if pool is None:
        at_a_time = workers or thread_count()
        pool = Processes(at_a_time) if executor is None else GivenExecutor(executor, at_a_time)
    work = identify_log if executor is not None else identify_log_alone
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
            runner = Runner(
                Task.of(template), store, pool, work, lost_log, title, len(logs), say, "logs"
            )
            runner.compute(missing)
        rows = store.rows(digests)
    return Fleet(template, tuple(logs), axis, rows, store)


def default_out(folder: Path) -> Path:
    """Default results folder."""
    return Path(f"{folder.absolute().name or 'fleet'}-fleet")


def template_of(folder: Path, path: str | Path | None = None) -> Template:
    """The experiment file that is named, or the one in the folder."""
    if path is None and not (folder / FILE).is_file():
        if not folder.is_dir():
            raise ExperimentError(f"{folder} is not a folder; name the folder of the logs")
        raise ExperimentError(
            f"{folder}: there is no {FILE} in it; write one, or name an experiment file with "
            "--experiment: robot, [recording] with columns, [controller], and [fleet]"
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
