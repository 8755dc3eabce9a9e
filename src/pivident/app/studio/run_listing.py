"""Runs as plain values for a page: what was asked, how far they are, what was written."""

from __future__ import annotations

import json
import os
import time
from collections.abc import Iterable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from pivident.app.studio.output import cleaned, shown
from pivident.app.studio.projects import EXPERIMENT, RESULTS
from pivident.app.studio.run_folder import (
    ACCOUNT,
    OUTPUT,
    RunFolder,
    iso,
    read_object,
    result_folders,
    run_numbers,
)
from pivident.foundation.text.identifiers import shortened

#: Bytes that are read at a time, and lines that are kept of what has been done.
CHUNK, KEPT = 1_000_000, 50


class RunProgress:
    """The last state of a run; each call of `now` reads only what is new.

    Args:
        path: the progress file.
    """

    def __init__(self, path: Path) -> None:
        self._path, self._offset, self._rest = path, 0, b""
        self._left: float | None = None
        self._written_at = 0.0
        self._stage, self._number, self._of, self._line = "", 0, 0, ""
        self._kept: list[str] = []

    def now(self) -> dict[str, Any]:
        """Stage, its number and how many there are, seconds left, last line, what has been done."""
        self._read()
        left = self._left
        if left is not None:
            left = max(left - (time.time() - self._written_at), 0.0)
        return {
            "stage": self._stage,
            "number": self._number,
            "of": self._of,
            "left_s": left,
            "line": self._line,
            "kept": list(self._kept),
        }

    def _read(self) -> None:
        try:
            status = self._path.stat()
            if status.st_size < self._offset:  # the run was begun again
                self.__init__(self._path)  # type: ignore[misc]
            self._written_at = status.st_mtime
            with self._path.open("rb") as file:
                file.seek(self._offset)
                while chunk := file.read(CHUNK):
                    self._offset += len(chunk)
                    *lines, self._rest = (self._rest + chunk).split(b"\n")
                    for line in lines:
                        with suppress(ValueError, TypeError, AttributeError):
                            self._take(json.loads(line))
        except OSError:
            return

    def _take(self, entry: dict[str, Any]) -> None:
        if "stages" in entry:
            expected = [float(seconds) for seconds in entry["stages"].values()]
            self._of, self._left = len(expected), sum(expected)
        if "left_s" in entry:
            self._left = float(entry["left_s"])
            self._number = int(entry.get("number", self._number))
            self._of = int(entry.get("of", self._of))
        self._stage = str(entry.get("stage", self._stage))
        self._line = _line(entry.get("say", self._line))
        if "keep" in entry:
            self._kept = [*self._kept, _line(entry["keep"])][-KEPT:]


def _line(value: Any) -> str:
    """A line for a page."""
    return shortened(cleaned(str(value)))


#: Most files of a run that are listed.
MAX_FILES = 500

#: Titles of pages by their names.
TITLES = {
    "report.html": "Report",
    "friction.html": "Friction",
    "comparison.html": "Comparison",
    "design.html": "Motion",
    "prediction.html": "Prediction",
}


class RunListing:
    """The runs of projects, cheap to read again: what has ended is read once."""

    def __init__(self) -> None:
        self._ended: dict[tuple[Path, str], tuple[object, dict[str, Any]]] = {}
        self._progress: dict[tuple[Path, str], RunProgress] = {}

    def of(self, project: Path) -> list[dict[str, Any]]:
        """All runs of a project, newest first."""
        results = result_folders(project)
        numbers = reversed(run_numbers(project))
        found = (self._entry(RunFolder(project, n), results.get(n, [])) for n in numbers)
        return [entry for entry in found if entry]

    def forget(self, run: RunFolder) -> None:
        """The run has been removed."""
        self._ended.pop((run.project, run.id), None)
        self._progress.pop((run.project, run.id), None)

    def _entry(self, run: RunFolder, results: list[str]) -> dict[str, Any]:
        key, mark = (run.project, run.id), _mark(run, results)
        known = self._ended.get(key)
        if known is not None and known[0] == mark:
            return dict(known[1])
        reader = self._progress.setdefault(key, RunProgress(run.state / "progress"))
        entry = _described(run, results, reader)
        if entry and entry["ended"]:
            self._progress.pop(key, None)
            self._ended[key] = (mark, entry)
        return dict(entry)


def _mark(run: RunFolder, results: Iterable[str]) -> object:
    """What changes when anything about an ended run does."""
    places = (run.state / "outcome.json", *(run.project / RESULTS / name for name in results))
    return [_changed(place) for place in places]


def _changed(path: Path) -> int:
    try:
        return path.stat().st_mtime_ns
    except OSError:
        return 0


def _described(run: RunFolder, results: list[str], reader: RunProgress) -> dict[str, Any]:
    """A run as plain values; empty where it is being added at this moment."""
    folder = run.project / RESULTS / results[0] if results else None
    record, started, outcome = run.record(), run.started(), run.outcome()
    if not record and folder is not None:  # its state has been removed
        record = started = outcome = _account(run, folder)
    if not record:
        return {}
    stage = "ended" if outcome else run.stage()
    state = outcome.get("state") or ("running" if stage == "running" else "waiting")
    there = folder is not None and bool(outcome)
    ended = str(outcome.get("ended", ""))
    output = shown(run.state / "stdout") or (shown(folder / OUTPUT) if folder else "")
    progress = reader.now()
    if ended:
        progress["left_s"] = None
    for key in ("line", "kept"):
        progress[key] = _named(progress[key], run)
    return {
        "id": run.id,
        "step": str(record.get("step", "")),
        "title": str(record.get("title", "")),
        "command": str(record.get("command", "")),
        "state": state,
        "code": outcome.get("code"),
        "message": _named(cleaned(str(outcome.get("message", ""))), run),
        "created": str(record.get("created", "")),
        "started": str(started.get("started", "")),
        "ended": ended,
        "progress": progress,
        "output": _named(output, run),
        "results": f"{RESULTS}/{results[0]}" if there else "",
        "pages": _pages(folder) if there and folder else [],
        "files": _files(folder) if there and folder else [],
        "experiment": str(record.get("experiment", "")),
        "methods": _methods(record, folder if there else None),
        "arguments": record.get("arguments", {}),
        "in_spite_of": record.get("in_spite_of", []),
    }


def _account(run: RunFolder, folder: Path) -> dict[str, Any]:
    """What the results say of their run; little where they come from elsewhere."""
    step = folder.name.partition("-")[2]
    written = {"step": step, "title": step, "state": "done", "ended": iso(folder.stat().st_mtime)}
    return written | read_object(folder / ACCOUNT)


def _named(text: Any, run: RunFolder) -> Any:
    """Lines about the experiment file instead of the copy of it that was read."""
    if isinstance(text, list):
        return [_named(line, run) for line in text]
    return text.replace(run.copy.name, EXPERIMENT)


def _files(folder: Path) -> list[dict[str, Any]]:
    """Files of results with their sizes, by path relative to the folder."""
    found: list[dict[str, Any]] = []
    for place, folders, names in os.walk(folder):
        folders.sort()
        for name in sorted(names):
            path = Path(place, name)
            if not path.is_symlink() and len(found) < MAX_FILES:
                size = path.stat().st_size
                found.append({"path": path.relative_to(folder).as_posix(), "bytes": size})
    return found


def _pages(folder: Path) -> list[dict[str, str]]:
    """Pages in results, that of the whole run first."""
    paths = [Path(file["path"]) for file in _files(folder) if file["path"].endswith(".html")]
    paths.sort(key=lambda path: (len(path.parts), path.as_posix()))
    return [{"title": _title(path), "path": path.as_posix()} for path in paths]


def _title(path: Path) -> str:
    title = TITLES.get(path.name, path.stem.replace("_", " ").capitalize())
    return title if len(path.parts) == 1 else f"{title} of {path.parent.as_posix()}"


def _methods(record: Mapping[str, Any], folder: Path | None) -> list[str]:
    """Short names of the methods that have results, or else of those that were asked for."""
    arguments = record.get("arguments")
    asked = arguments.get("method") if isinstance(arguments, dict) else None
    if isinstance(asked, str):
        asked = asked.split(",")
    names = [str(name).strip() for name in asked or []]
    if folder is not None:
        several = [p.parent.name for p in folder.glob("*/identification.json")]
        order = {name.removeprefix("pc-"): k for k, name in reversed(list(enumerate(names)))}
        one = read_object(folder / "verdict.json").get("name")
        if several or one:
            return sorted(several, key=lambda n: (order.get(n, len(order)), n)) or [str(one)]
    return names
