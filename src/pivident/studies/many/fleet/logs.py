"""The logs of a folder by patterns of their paths: robot, day, and files of the same record.

Patterns of paths (`logs`) distinguish logs, and a part of the path gives the time of each.
Without a pattern every readable file is a log; its robot is its folder.

Patterns of the paths of logs, and their captures.

A pattern is a path below the folder in which ``{name}`` stands for a part without ``/`` that
distinguishes logs, and ``*`` for a part that does not:

    {robot}/{day}.csv                         arm_03/2026-03-01.csv
    {robot}_{day}.csv                         arm_03_2026-03-01.csv: the first part takes most
    {robot}/{day}/{run}.parquet               with together = ["robot", "day"]: runs of one problem
    {q = "{robot}/{day}/q.csv", tau = "{robot}/{day}/tau.csv"}      files of one record
"""

from __future__ import annotations

import hashlib
import os
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path

from pivident.data.logs.source_files import existing_file, sha256
from pivident.data.logs.tables.tables import is_log
from pivident.foundation.errors import ExperimentError, PividentError
from pivident.studies.many.fleet.fleet_keys import EVERY_LOG

#: Captures with the time of a record, unless the file names another one.
TIMES = ("time", "day", "date")
#: Maximum number of parts of one folder's or file's name in a pattern.
MAX_PARTS = 4
#: The capture with the name of the robot.
ROBOT = "robot"
_CAPTURE = re.compile(r"\{([^{}]*)\}|(\*)")
#: Names and values of what a path captures.
Captures = tuple[tuple[str, str], ...]


@dataclass(frozen=True)
class FleetLog:
    """Files of one identification problem."""

    name: str  # its captures, ``arm_03/2026-03-01``; unique
    captures: Captures  # name and value of each
    # files of each of its records, by the key of ``files``
    records: tuple[tuple[tuple[str, str], ...], ...]
    time: str = ""  # an ISO date or a number; empty if only the order is known
    # position on the time axis: days since 1970, or that number, or its rank
    position: float = 0.0
    fault: PividentError | None = None  # why it cannot be read

    @property
    def robot(self) -> str:
        """Name of the robot."""
        return dict(self.captures)[ROBOT]

    @property
    def paths(self) -> tuple[str, ...]:
        """All files."""
        return tuple(dict.fromkeys(path for record in self.records for _, path in record))

    def digest(self) -> str:
        """SHA-256 of the file; of several, that of the list of keys and hashes."""
        hashes = [
            (key, sha256(existing_file(path))) for record in self.records for key, path in record
        ]
        if len(hashes) == 1:
            return hashes[0][1]

        return hashlib.sha256("\n".join(f"{k} {h}" for k, h in hashes).encode()).hexdigest()


@dataclass(frozen=True)
class TimeAxis:
    """Meaning of positions in time."""

    kind: str  # ``date``, ``number`` or ``order``
    unit: str  # of a rate: ``day``, the capture's name, or ``record``


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


def find_logs(
    folder: Path,
    pattern: str | Mapping[str, str],
    together: Sequence[str] | None = None,
    time: str | None = None,
    without: Path | None = None,
) -> tuple[list[FleetLog], TimeAxis]:
    """The logs of a folder in the order of robots and time, and their time axis.

    ``together``: captures whose logs are one problem; None: all. ``time``: the capture with the
    time; None: the first of ``TIMES``. ``without``: folder that is left out.
    """
    if not folder.is_dir():
        problem = "is a file" if folder.exists() else "does not exist"
        raise ExperimentError(f"{folder} {problem}", advice="name the folder of the logs")
    files = _files(folder, without)
    if pattern == EVERY_LOG:
        keys = {"log": _every_log(folder, files)}
        names: tuple[str, ...] = (ROBOT, "log")
        named_time = time
    else:
        patterns = dict(pattern) if isinstance(pattern, Mapping) else {"log": pattern}
        compiled = {key: Pattern(key, text) for key, text in patterns.items()}
        names = _same_names(compiled)
        names = names if ROBOT in names else (ROBOT, *names)
        keys = {key: one.matches(files, folder.absolute().name) for key, one in compiled.items()}
        named_time = time or next((name for name in TIMES if name in names), None)
    logs = _grouped(folder, keys, _chosen(names, together, named_time))
    if not logs:
        wanted = "readable log" if pattern == EVERY_LOG else f"file that matches {pattern!r}"
        example = f"; there is {files[0]!r}, for example" if files else "; it has no files"
        raise ExperimentError(
            f"{folder}: there is no {wanted}{example}",
            advice="correct files or pattern, in which {robot} and {day} stand for parts of a path",
        )
    return _in_time(logs, named_time)


def _files(folder: Path, without: Path | None) -> list[str]:
    """Paths of all files below a folder, with slashes, sorted; hidden ones are left out."""
    found = []
    excluded = None if without is None else without.absolute()
    for place, folders, names in os.walk(folder):
        here = Path(place)
        folders[:] = sorted(
            f for f in folders if not f.startswith(".") and (here / f).absolute() != excluded
        )
        if here.absolute() == excluded:
            continue
        found += [
            (here / name).relative_to(folder).as_posix()
            for name in names
            if not name.startswith(".")
        ]
    return sorted(found)


def _every_log(folder: Path, files: Sequence[str]) -> dict[Captures, str]:
    """All files with a reader; the robot is the folder, the log the file's name."""
    found: dict[Captures, str] = {}
    for file in files:
        path = Path(file)
        if not is_log(path.name):
            continue
        parent = path.parent.as_posix()
        robot = folder.absolute().name if parent == "." else parent
        found[((ROBOT, robot), ("log", path.name))] = file
    return found


def _same_names(patterns: Mapping[str, Pattern]) -> tuple[str, ...]:
    """Captures of all patterns, which must be the same for files of one record."""
    (first, pattern), *others = patterns.items()
    for key, other in others:
        if set(other.names) != set(pattern.names):
            raise ExperimentError(
                f"the patterns of {first!r} and {key!r} contain {', '.join(pattern.names)} and "
                f"{', '.join(other.names)}",
                advice="files of one record need the same parts",
            )
    return pattern.names


def _chosen(
    names: Sequence[str], together: Sequence[str] | None, time: str | None
) -> tuple[str, ...]:
    """Captures that distinguish problems."""
    chosen = tuple(names if together is None else [n for n in names if n in together])
    for key, wanted in (("together", list(together or ())), ("time", [time] if time else [])):
        for name in wanted:
            if name not in names:
                raise ExperimentError(
                    f"[fleet] {key} names {name!r}, but the pattern contains {', '.join(names)}"
                )
    if together is not None and (ROBOT not in chosen or (time and time not in chosen)):
        raise ExperimentError(
            f"[fleet] together = {list(together)} joins records of different robots or times",
            advice=f"it must contain robot{f' and {time}' if time else ''}",
        )
    return chosen


def _grouped(
    folder: Path, keys: Mapping[str, Mapping[Captures, str]], chosen: Sequence[str]
) -> list[FleetLog]:
    """Files grouped by record, and records by problem."""
    every: dict[tuple[tuple[str, str], ...], None] = {}
    canonical: dict[str, dict[frozenset[tuple[str, str]], str]] = {}
    for key, found in keys.items():
        canonical[key] = {frozenset(captures): file for captures, file in found.items()}
        every |= dict.fromkeys(tuple(sorted(captures)) for captures in found)
    problems: dict[Captures, list[tuple[tuple[str, str], ...]]] = {}
    faults: dict[Captures, PividentError] = {}
    for captures in sorted(every):
        values = dict(captures)
        problem = tuple((name, values[name]) for name in chosen)
        files = {key: canonical[key].get(frozenset(captures)) for key in keys}
        missing = [key for key, file in files.items() if file is None]
        if missing:
            said = ", ".join(f"{name} {value}" for name, value in captures)
            faults[problem] = PividentError(
                f"there is no file for {missing[0]!r} of {said}, but one for "
                f"{next(f for f in files.values() if f)!r}",
                advice="add it, or remove the other",
            )
        record = tuple((key, str(folder / file)) for key, file in files.items() if file)
        problems.setdefault(problem, []).append(record)
    return [
        FleetLog("/".join(v for _, v in p), p, tuple(records), fault=faults.get(p))
        for p, records in problems.items()
    ]


def _in_time(logs: Sequence[FleetLog], name: str | None) -> tuple[list[FleetLog], TimeAxis]:
    """The logs with their positions in time, sorted by robot and time."""
    said = {
        log.name: dict(log.captures)[name] if name else date_in(dict(log.captures).get("log", ""))
        for log in logs
    }
    kind, read = kind_of_times(list(said.values()), required=name is not None)
    if read is None:
        robots: dict[str, list[FleetLog]] = {}
        for log in sorted(logs, key=lambda log: log.name):
            robots.setdefault(log.robot, []).append(log)
        ranked = [
            replace(g, position=k + 1.0) for own in robots.values() for k, g in enumerate(own)
        ]
        return _sorted(ranked), TimeAxis("order", "record")
    made = []
    for log in logs:
        value = read(said[log.name])
        if value is None:
            fault = PividentError(
                f"{name} = {said[log.name]!r} is not a {kind}, unlike those of the other logs",
                advice="rename the file, or name another part as time under [fleet]",
            )
            made.append(replace(log, fault=log.fault or fault))
        else:
            made.append(replace(log, time=value[1], position=value[0]))
    return _sorted(made), TimeAxis(kind, "day" if kind == "date" else str(name))


def _sorted(logs: Sequence[FleetLog]) -> list[FleetLog]:
    return sorted(logs, key=lambda log: (log.robot, log.position, log.name))
