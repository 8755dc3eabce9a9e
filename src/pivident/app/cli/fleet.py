"""The command ``pivident fleet``: many robots or days, their parameters over time, and alarms."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from pivident.app.cli.console import Progress, chosen_pool, note
from pivident.foundation.errors import ExperimentError
from pivident.foundation.text.identifiers import escaped

if TYPE_CHECKING:
    from pivident.studies.many.fleet.judgement import Judgement

#: Alarms and failed logs that are printed; all are in the files.
MAX_PRINTED = 20


def fleet(
    folder: Path,
    /,
    *,
    experiment: Path | None = None,
    out: Path | None = None,
    level: Annotated[float | None, Parameter(show_default=False)] = None,
    workers: int | None = None,
    dask: Annotated[bool, Parameter(negative=())] = False,
    scheduler: str | None = None,
) -> int:
    """Identify many robots, or many days of one, and report which parameters have changed.

    Logs that are in the results already are kept: the same command continues where it was stopped,
    and does only what is new or has changed.

    Parameters
    ----------
    folder
        Folder with the logs.
    experiment
        Experiment file for all of them, with a table [fleet]. Default: fleet.toml in the folder.
    out
        Folder for the results. Default: NAME-fleet for the folder NAME.
    level
        Probability of one false alarm or more in the whole fleet and period. Default: that of the
        file, or else 0.05.
    workers
        Processes on this machine. Default: one for each core.
    dask
        Use a Dask cluster on this machine.
    scheduler
        Use the Dask cluster of the scheduler at this address, tcp://host:8786; its workers read
        the logs, so they must see the folder.
    """
    from pivident.foundation.files import check_output
    from pivident.studies.many.fleet.conclusion import conclude_fleet
    from pivident.studies.many.fleet.identify_fleet import default_out, identify_fleet, template_of

    if level is not None and not 0.0 < level < 1.0:
        raise ExperimentError(
            f"--level {level:g} is not a probability of a false alarm",
            advice="give one between 0 and 1, such as 0.05",
        )
    template = template_of(folder, experiment)
    if level is not None:
        template = template.with_level(level)
    place = out or default_out(folder)
    check_output(place)
    pool = chosen_pool(workers, dask, scheduler)
    with Progress() as progress:
        try:
            found = identify_fleet(folder, template, place, pool=pool, say=progress.say)
        except KeyboardInterrupt:
            note(f"the logs that have finished are in {place}; the same command continues there")
            raise
        judgement = conclude_fleet(found, progress.say)
    _print(judgement, place)
    if len(found.failures) < len(found.logs):
        return 0
    note("error: no log gave an estimate; the table shows why")
    return 1


def _print(judgement: Judgement, place: Path) -> None:
    """Alarms, what they promise, what could not be judged, and where the files are."""
    from pivident.studies.many.fleet.conclusion import ALARMS, PAGE, PARAMETERS
    from pivident.studies.many.fleet.judgement import judgement_text

    print(escaped(judgement_text(judgement, MAX_PRINTED)))
    for name, path in (("Table", PARAMETERS), ("Alarms", ALARMS), ("Page", PAGE)):
        print(f"{name + ':':8}{place / path}")
