"""Patterns of the paths of logs, and their captures.

A pattern is a path below the folder in which ``{name}`` stands for a part without ``/`` that
distinguishes logs, and ``*`` for a part that does not:

    {robot}/{day}.csv                         arm_03/2026-03-01.csv
    {robot}_{day}.csv                         arm_03_2026-03-01.csv: the first part takes most
    {robot}/{day}/{run}.parquet               with together = ["robot", "day"]: runs of one problem
    {q = "{robot}/{day}/q.csv", tau = "{robot}/{day}/tau.csv"}      files of one record
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from datetime import UTC, datetime

from pivident.errors import ExperimentError

#: Maximum number of parts of one folder's or file's name in a pattern.
MAX_PARTS = 4

#: The capture with the name of the robot.
ROBOT = "robot"

_CAPTURE = re.compile(r"\{([^{}]*)\}|(\*)")

#: Names and values of what a path captures.
Captures = tuple[tuple[str, str], ...]


class Pattern:
    """One pattern of paths for the files of ``key``."""

    def __init__(self, key: str, text: str) -> None:
        self.text = text
        self.names: tuple[str, ...] = ()
        where = f"pattern {text!r}"
        expression, end = "", 0
        for found in _CAPTURE.finditer(text):
            if end == found.start() and end > 0:
                raise ExperimentError(
                    f"{where}: {found.group()} follows another part directly, so the boundary is "
                    "ambiguous",
                    advice="put a character such as _ or / between them",
                )
            expression += re.escape(text[end : found.start()])
            end = found.end()
            name = found[1]
            if name is None:
                expression += "[^/]*"
                continue
            if not re.fullmatch(r"[A-Za-z]\w{0,31}", name):
                raise ExperimentError(
                    f"{where}: {{{name}}} is not a valid name",
                    advice="use letters, digits and _, such as {robot}",
                )
            if name in self.names:
                expression += f"(?P={name})"
            else:
                expression += f"(?P<{name}>[^/]+)"
                self.names += (name,)
        if max(len(_CAPTURE.findall(part)) for part in text.split("/")) > MAX_PARTS:
            raise ExperimentError(
                f"{where} has more than {MAX_PARTS} parts in braces or * between two slashes, so "
                "names are ambiguous",
                advice="use folders or fewer parts",
            )
        rest = text[end:]
        if "{" in rest or "}" in rest or not self.names:
            raise ExperimentError(
                f"{where} of {key!r} needs parts in braces that distinguish logs, such as "
                "'{robot}/{day}.csv'"
            )
        self.expression = re.compile(expression + re.escape(rest), re.DOTALL)

    def matches(self, files: Sequence[str], robot: str) -> dict[Captures, str]:
        """Files by their captures."""
        found: dict[Captures, str] = {}
        for file in files:
            match = self.expression.fullmatch(file)
            if match is None:
                continue
            captures = tuple(match.groupdict().items())
            if ROBOT not in self.names:
                captures = ((ROBOT, robot), *captures)
            if captures in found:
                raise ExperimentError(
                    f"pattern {self.text!r} finds {found[captures]!r} and {file!r} for the same "
                    f"{', '.join(f'{k} {v}' for k, v in captures)}",
                    advice="add a part such as {run}",
                )
            found[captures] = file
        return found


_DATE = re.compile(r"(?<!\d)(\d{4}-?[01]\d-?[0-3]\d)(?!\d)")

#: Position on the time axis and text of a moment, None for another text.
Moment = Callable[[str], tuple[float, str] | None]


def kind_of_times(texts: Sequence[str], required: bool) -> tuple[str, Moment | None]:
    """``date``, ``number`` or ``order`` (if unclear), and the parser of such a text.

    A minority of texts named as times (``required``) may be faulty.
    """
    for kind, read in (("date", as_date), ("number", as_number)):
        wrong = sum(read(text) is None for text in texts)
        if wrong == 0 or (required and 2 * wrong < len(texts)):
            return kind, read
    return "order", None


def date_in(name: str) -> str:
    """A date in the name of a file, empty without one."""
    found = _DATE.search(name)
    return found[1] if found else ""


def as_date(text: str) -> tuple[float, str] | None:
    """Days since 1970 and ISO text of a date (and time of day), None for another text."""
    for candidate in _spellings(text):
        try:
            moment = datetime.fromisoformat(candidate)
        except ValueError:
            continue
        aware = moment if moment.tzinfo else moment.replace(tzinfo=UTC)
        plain = moment.date().isoformat() if len(text) <= 10 else moment.isoformat()
        return aware.timestamp() / 86400.0, plain
    return None


def _spellings(text: str) -> Iterator[str]:
    """A moment in ISO format, and in that of file names, where ':' is not allowed."""
    yield text
    found = re.fullmatch(r"(\d{4}-?\d\d-?\d\d)[T_ -](\d\d)[-_.]?(\d\d)(?:[-_.]?(\d\d))?", text)
    if found:
        yield f"{found[1]}T{found[2]}:{found[3]}:{found[4] or '00'}"


def as_number(text: str) -> tuple[float, str] | None:
    """A finite number, None for another text."""
    try:
        value = float(text)
    except ValueError:
        return None
    return (value, text) if abs(value) < 1e15 else None
