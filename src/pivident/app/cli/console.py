"""What the command line says while it works and when it ends: notes, progress, errors, exit codes.

Progress of a command for the program that started it: JSON, a line each, at the end of a file.

The environment variable ``PIVIDENT_PROGRESS`` names the file:

    {"stages": {"ls": 3.1, "piv": 14.0}, "left_s": 18.9}    what will be done, expected seconds
    {"stage": "piv", "number": 2, "of": 4, "left_s": 15.2}  a stage begins
    {"say": "PIV: iteration 3 …", "number": 2, "of": 4, "left_s": 9.7}
    {"keep": "IDIM-PIV: 6 iterations …"}                    what has been done

How commands end: their exit codes, and the error of a command line that means nothing.

Findings on the command line: a line each, broken and coloured on a terminal.

Where commands with many tasks compute them: processes here, or a Dask cluster.
"""

from __future__ import annotations

import os
import sys
import time
import warnings
from collections.abc import Iterable
from contextlib import suppress
from importlib.util import find_spec
from pathlib import Path
from textwrap import wrap
from types import TracebackType
from typing import TYPE_CHECKING, Any

from pivident.foundation.errors import ExperimentError, PividentError, in_words
from pivident.foundation.extras import is_installed
from pivident.foundation.registry import ExtensionWarning
from pivident.foundation.text.finding import Finding, Severity
from pivident.foundation.text.identifiers import escaped
from pivident.foundation.text.plain_values import plain, strict_json

if TYPE_CHECKING:
    from collections.abc import Mapping

    from rich.status import Status
    from rich.text import Text

    from pivident.app.cli.remaining import Remaining
    from pivident.robot.description import Robot
    from pivident.studies.many.batch.runner import Pool


#: How Python prints a warning.
_WITH_PLACE = warnings.formatwarning
#: The environment variable that names the file.
ENVIRONMENT = "PIVIDENT_PROGRESS"
#: When the command began, by `time.perf_counter` [s].
BEGUN = time.perf_counter()
DONE, WRONG_INPUT, WRONG_USAGE, NOT_CONVERGED, FAULTY_LOG, INTERRUPTED = 0, 1, 2, 3, 4, 130


def note(line: str) -> None:
    """One line on standard error."""
    print(escaped(line), file=sys.stderr, flush=True)


def name_bodies(robot: Robot) -> None:
    """Links of a description that no body can be, on standard error: what is computed uses them."""
    from pivident.experiment.check.robot_check import check_bodies

    file = robot.name if robot.urdf is None or not robot.urdf.path else Path(robot.urdf.path).name
    for finding in check_bodies(robot, file):
        note(f"warning: {finding.message} {finding.next_step}")


def warning_text(
    message: Warning | str,
    category: type[Warning],
    filename: str,
    lineno: int,
    line: str | None = None,
) -> str:
    """A warning as it is printed; in one line, without its place, where an addition is broken."""
    return (
        f"warning: {message}\n"
        if issubclass(category, ExtensionWarning)
        else _WITH_PLACE(message, category, filename, lineno, line)
    )


def error_line(error: BaseException) -> str:
    """An error with its notes as one readable line.

    An error that pivident has not raised on purpose is a mistake in it, and says so.
    """
    if package := missing_package(error):
        return (
            f"error: this installation has no {package.rpartition('.')[2]!r}: {package} was left "
            "out of it; install the whole of pivident to use this command"
        )
    return f"error: {in_words(error)}"


def missing_package(error: BaseException) -> str | None:
    """Name of the package of pivident that an import did not find because it was left out."""
    name = (isinstance(error, ModuleNotFoundError) and error.name) or ""
    return name if name.startswith("pivident.") and find_spec(name) is None else None


class ProgressChannel:
    """Appends to the file that the environment names; without one, nothing is written.

    Progress is a courtesy: a file that cannot be written, on a full disk for instance, does not end
    the work.
    """

    def __init__(self) -> None:
        self._path = os.environ.get(ENVIRONMENT, "")

    def write(self, **entry: Any) -> None:
        """Append one line, whole or not at all.

        Args:
            entry: plain values by name.
        """
        if self._path:
            line = f"{strict_json(plain(entry))}\n".encode(errors="backslashreplace")
            with suppress(OSError), open(self._path, "ab", buffering=0) as file:
                file.write(line)


class Progress:
    """Where a long run is: a line that changes on a terminal, plain lines elsewhere.

    Use it as a context; `say` replaces the current line, `keep` leaves one behind. On a terminal
    the line begins with the stage and the time that is left, once `stages` says what is expected.
    A program that has started the command reads the same from a file; see `ProgressChannel`.
    """

    def __init__(self) -> None:
        self._channel = ProgressChannel()
        self._status: Status | None = None
        self._remaining: Remaining | None = None
        self._before: tuple[float, float] | None = None
        self._line = ""

    def __enter__(self) -> Progress:
        if sys.stderr.isatty():
            from rich.console import Console

            self._status = Console(stderr=True, highlight=False).status("")
            self._status.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        if self._status is not None:
            self._status.stop()
            self._status = None

    def ready(self, expected: float) -> None:
        """What came before the stages is done, of which so many seconds were expected."""
        self._before = expected, time.perf_counter() - BEGUN

    def stages(self, expected: Mapping[str, float]) -> None:
        """What stages there will be, and how long each is expected to take [s]."""
        from pivident.app.cli.remaining import PRIOR, Remaining

        self._remaining = Remaining(expected, before=self._before or PRIOR)
        self._channel.write(stages=dict(expected), left_s=round(self._remaining.seconds, 1))

    def begin(self, stage: str) -> None:
        """The next stage begins."""
        if self._remaining is not None:
            self._remaining.begin(stage)
            self._channel.write(stage=stage, **self._remaining.place())

    def say(self, line: str) -> None:
        """What is being done now."""
        self._line = line
        left = {} if self._remaining is None else self._remaining.place()
        self._channel.write(say=line, **left)
        if self._status is None:
            note(line)
        else:
            self._status.update(self)

    def __rich__(self) -> Text:
        """The line as it is drawn again and again while it stands: its time goes on."""
        from rich.text import Text

        left = "" if self._remaining is None else str(self._remaining)
        line = Text(no_wrap=True, overflow="ellipsis")
        return line.append(f"{left}: " if left else "", style="dim").append(escaped(self._line))

    def keep(self, line: str) -> None:
        """What has been done; stays on the screen."""
        self._channel.write(keep=line)
        if self._status is None:
            note(line)
        else:
            from rich.text import Text

            self._status.console.print(Text(escaped(line)))


class UsageError(PividentError, ValueError):
    """A command line that cannot be understood."""


#: How severities look on a terminal with colours.
STYLES: dict[Severity, str] = {
    "error": "bold red",
    "warning": "yellow",
    "note": "",
    "ok": "green",
}

#: Width of a line on a terminal; lines of a file or a pipe are not broken.
WIDTH = 96


def print_findings(findings: Iterable[Finding]) -> None:
    """Severity, place, message and next step of each."""
    from rich.console import Console
    from rich.text import Text

    console = Console(highlight=False)
    for finding in findings:
        word = f"  {finding.severity:<7} "
        heading = f"{finding.heading}:" if finding.heading else ""
        lines = [escaped(x) for x in (heading, finding.message, finding.next_step) if x]
        if not sys.stdout.isatty():
            print(word + " ".join(lines))
            continue
        broken = [part for line in lines for part in wrap(line, WIDTH - len(word))]
        console.print(Text(word, STYLES[finding.severity]), end="")
        console.print(Text(f"\n{' ' * len(word)}".join(broken)))


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


def can_draw(progress: Progress, page: str = "report.html") -> bool:
    """Whether a page can be written; says what to install where it cannot."""
    drawn = is_installed("plotly")
    if not drawn:
        progress.keep(f"{page} needs plotly, pip install 'pivident[report]'; all else is written")
    return drawn
