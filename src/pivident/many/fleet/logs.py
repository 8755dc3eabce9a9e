"""The logs of a folder: robot, day, and files of the same record.

Patterns of paths (`log_pattern`) distinguish logs, and a part of the path gives the time of each.
Without a pattern every readable file is a log; its robot is its folder.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from pivident.errors import ExperimentError
from pivident.logs.source_files import existing_file, sha256
from pivident.logs.tables.tables import is_log
from pivident.many.fleet.fleet_schema import EVERY_LOG
from pivident.many.fleet.log_pattern import ROBOT, Captures, Pattern, date_in, kind_of_times

#: Captures with the time of a record, unless the file names another one.
TIMES = ("time", "day", "date")


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
    fault: str = ""  # why it cannot be read, else empty

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
        import hashlib

        return hashlib.sha256("\n".join(f"{k} {h}" for k, h in hashes).encode()).hexdigest()


@dataclass(frozen=True)
class TimeAxis:
    """Meaning of positions in time."""

    kind: str  # ``date``, ``number`` or ``order``
    unit: str  # of a rate: ``day``, the capture's name, or ``record``


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
    chosen = _chosen(names, together, named_time)
    logs = _grouped(folder, keys, chosen)
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
    faults: dict[Captures, str] = {}
    for captures in sorted(every):
        values = dict(captures)
        problem = tuple((name, values[name]) for name in chosen)
        files = {key: canonical[key].get(frozenset(captures)) for key in keys}
        missing = [key for key, file in files.items() if file is None]
        if missing:
            said = ", ".join(f"{name} {value}" for name, value in captures)
            faults[problem] = (
                f"there is no file for {missing[0]!r} of {said}, but one for "
                f"{next(f for f in files.values() if f)!r}; add it, or remove the other"
            )
        record = tuple((key, str(folder / file)) for key, file in files.items() if file)
        problems.setdefault(problem, []).append(record)
    return [
        FleetLog("/".join(v for _, v in p), p, tuple(records), fault=faults.get(p, ""))
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
            fault = (
                f"{name} = {said[log.name]!r} is not a {kind}, unlike those of the other logs; "
                "rename the file, or name another part as time under [fleet]"
            )
            made.append(replace(log, fault=log.fault or fault))
        else:
            made.append(replace(log, time=value[1], position=value[0]))
    return _sorted(made), TimeAxis(kind, "day" if kind == "date" else str(name))


def _sorted(logs: Sequence[FleetLog]) -> list[FleetLog]:
    return sorted(logs, key=lambda log: (log.robot, log.position, log.name))
