"""Designs beside the records of an experiment: what they predicted, and what was reached."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from pivident.app.cli.console import Progress, missing_package
from pivident.data.recording.recording import Recording
from pivident.estimation.identification import Identification
from pivident.experiment.experiment import Experiment
from pivident.experiment.recording_tables import design_file
from pivident.foundation.errors import PividentError
from pivident.foundation.text.plain_values import write_json

if TYPE_CHECKING:
    from pivident.studies.excitation.reached import ReachedErrors

#: Files of the comparison in a folder of results.
TEXT_FILE, JSON_FILE = "design_check.txt", "design_check.json"


def designs_beside(
    experiment: Experiment,
    recordings: Sequence[Recording],
    result: Identification,
    progress: Progress,
) -> tuple[ReachedErrors, ...]:
    """What designs predicted of the records that follow them, beside what a result reached.

    A design that cannot be read is reported and ends nothing. Without any, the package that designs
    motions is not needed.
    """
    folder = experiment.path.parent
    files = [design_file(entry, folder) for entry in experiment.content.recording]
    if not any(files):
        return ()
    found: list[ReachedErrors] = []
    try:
        from pivident.studies.excitation.reached import reached_errors
    except ModuleNotFoundError as error:
        if missing_package(error) is None:
            raise
        progress.keep("the design beside the log is not compared: this installation has no "
                      "'excitation'")  # fmt: skip
        return ()
    for file in dict.fromkeys(f for f in files if f is not None):
        own = [f if f == file else None for f in files]
        try:
            found += reached_errors(own, recordings, result)
        except PividentError as error:
            progress.keep(f"the design is not compared: {error}")
    return tuple(found)


def write_designs(found: Sequence[ReachedErrors], build: Path) -> None:
    """The comparisons as text and as JSON; nothing where there is none."""
    if not found:
        return

    text = "\n\n".join(map(str, found))
    (build / TEXT_FILE).write_text(f"{text}\n", encoding="utf-8", errors="backslashreplace")
    write_json(build / JSON_FILE, {"schema": 1, "designs": [own.to_values() for own in found]})
