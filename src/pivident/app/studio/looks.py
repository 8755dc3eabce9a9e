"""The current look at each project: begun when its inputs change, the older one stopped.

A look has signals of the logs to draw, then everything that is wrong with them:

    experiment file ─▶ signals/   recordings, channels, the arm in motion
                    ─▶ findings/  check, audit and its page

Both are derived and belong to one state of the inputs, whose hash names their folder. Each appears
whole or not at all.

The files that an experiment file names: by name, by a pattern, or as a bag of several.
"""

from __future__ import annotations

import glob
import hashlib
import json
import os
import shutil
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any, Literal

from pivident.app.studio.arm_picture import robot_picture as robot_picture
from pivident.app.studio.fixes import fixes
from pivident.app.studio.logged_signals import write_signals
from pivident.app.studio.projects import EXPERIMENT, HIDDEN
from pivident.app.studio.tasks import Tasks
from pivident.experiment.check.experiment_check import ExperimentCheck, check_experiment
from pivident.experiment.recording_tables import DESIGN_FILE
from pivident.foundation.common_work import numbers_beside
from pivident.foundation.errors import PividentError
from pivident.foundation.extras import is_installed
from pivident.foundation.files import BUILD, atomic_folder
from pivident.foundation.text.plain_values import plain, strict_json, write_json
from pivident.foundation.text.toml import parse_toml
from pivident.judgement.audit.audit import audits_json

#: The two stages.
STAGES = ("signals", "findings")

#: Content of the second stage.
CHECK, AUDIT, AUDIT_PAGE = "check.json", "audit.json", "audit.html"

#: Which signals a folder holds, as the hash of what they follow from.
_SIGNALS_KEY = "key"

#: Tables of the file that say what the signals are, and those that hold recordings of their own.
_TABLES = ("robot", "recording", "wrench", "contact")
_WITH_RECORDINGS = ("validation", "gains", "payload")


def look_key(experiment: Path) -> str:
    """Hash of the text, and of name, size and time of every file that it names.

    Args:
        experiment: the experiment file; one that is not there has a key too.
    """
    text = _text(experiment)
    return _hash(text, *_stamps(experiment.parent, text))


def look(experiment: Path, folder: Path, say: Callable[[str], None]) -> None:
    """Write ``signals/`` and then ``findings/``; bad input is a message in them.

    Args:
        experiment: the experiment file.
        folder: where both are written; those beside it may lend their signals.
        say: called with one line at each stage.

    Raises:
        PividentError: the folder cannot be written.
    """
    folder.mkdir(parents=True, exist_ok=True)
    key = _signals_key(experiment)
    if not is_complete(folder, STAGES[0]) and not _borrowed(folder, key):
        with atomic_folder(folder / STAGES[0]) as build:
            write_signals(experiment, build, say)
            (build / _SIGNALS_KEY).write_text(key, encoding="utf-8")
    with atomic_folder(folder / STAGES[1]) as build:
        _write_findings(experiment, build, say)


def is_complete(folder: Path, stage: str) -> bool:
    """Whether a stage has appeared in a folder of `look`."""
    return (folder / stage).is_dir()


def _write_findings(experiment: Path, folder: Path, say: Callable[[str], None]) -> None:
    """What the check has found, and the audit with its page."""
    try:
        with numbers_beside(experiment):
            found = check_experiment(experiment, progress=say)
    except PividentError as error:
        write_json(folder / CHECK, {"error": " ".join(str(error).split()), "remarks": []})
        write_json(folder / AUDIT, {"error": " ".join(str(error).split()), "audits": []})
        return
    write_json(folder / CHECK, _with_fixes(found, _text(experiment)) | {"error": ""})
    _write_audit(found, folder, say)


def _with_fixes(found: ExperimentCheck, text: str) -> dict[str, Any]:
    """The check as plain values, each remark with the robot's joints and its fixes."""
    content = found.as_json()
    joints = next((list(audit.log.joint_names) for audit in found.audits), [])
    for remark in content["remarks"]:
        remark["joints"] = joints
        remark["fixes"] = plain(fixes(remark, text))
    return content


def _write_audit(found: ExperimentCheck, folder: Path, say: Callable[[str], None]) -> None:
    """The audits of the check, and their page where it can be drawn."""
    write_json(folder / AUDIT, plain(audits_json(found.audits)) | {"error": ""})
    if found.audits and is_installed("plotly"):
        from pivident.judgement.report.audit_account import render_page

        say("drawing the audit")
        page = render_page(found.audits)
        (folder / AUDIT_PAGE).write_text(page, encoding="utf-8", errors="backslashreplace")


def _borrowed(folder: Path, key: str) -> bool:
    """Whether a look beside this one had the same signals, which are then linked here."""
    for other in sorted(folder.parent.glob(f"*/{STAGES[0]}/{_SIGNALS_KEY}")):
        source = other.parent
        with suppress(OSError, PividentError):
            if source.parent == folder or other.read_text(encoding="utf-8") != key:
                continue
            with atomic_folder(folder / STAGES[0]) as build:
                for file in source.iterdir():
                    os.link(file, build / file.name)
            return is_complete(folder, STAGES[0])
    return False


def _signals_key(experiment: Path) -> str:
    """Hash of what the signals follow from: tables of robot and recordings, and their files."""
    text = _text(experiment)
    stamps = list(_stamps(experiment.parent, text))
    try:
        content = parse_toml(text)
    except ValueError:
        return _hash(text, *stamps)
    tables = {name: content[name] for name in _TABLES if name in content}
    tables |= {
        name: content[name]["recording"]
        for name in _WITH_RECORDINGS
        if isinstance(content.get(name), dict) and "recording" in content[name]
    }
    return _hash(json.dumps(tables, sort_keys=True, default=str), *stamps)


def _text(experiment: Path) -> str:
    """The text of the file, empty where it cannot be read."""
    try:
        return experiment.read_text(encoding="utf-8", errors="surrogateescape")
    except OSError:
        return ""


def _hash(*parts: str) -> str:
    return hashlib.sha256("\0".join(parts).encode("utf-8", "surrogateescape")).hexdigest()[:24]


def _stamps(folder: Path, text: str) -> Iterator[str]:
    """Name, size and time of every file that a text of the file's value names, in order."""
    try:
        content = parse_toml(text)
    except ValueError:
        return
    for path in named_files(folder, content):
        with suppress(OSError):
            about = path.stat()
            yield strict_json([str(path), about.st_size, about.st_mtime_ns])


def remove_unfinished(folder: Path) -> None:
    """Remove what a look that was killed has left, unless its signals are there to be shared."""
    if not is_complete(folder, STAGES[0]):
        shutil.rmtree(folder, ignore_errors=True)
        return
    for left in folder.glob(f"{BUILD}*"):
        shutil.rmtree(left, ignore_errors=True)


#: Looks of a project that are kept: the current one, and the one before, to which people go back.
KEPT = 2

Stage = Literal["none", "running", "ready", "failed"]


class Looks:
    """Looks of all projects; the methods may be called from any thread."""

    def __init__(self, tasks: Tasks) -> None:
        self._tasks = tasks
        self._begun: dict[Path, str] = {}  # key of the last look of each project
        self._lock = threading.RLock()

    def want(self, project: Path) -> str:
        """Begin a look if the inputs have none yet, and stop one at older inputs.

        Returns:
            The key of the inputs.
        """
        key = look_key(project / EXPERIMENT)
        folder = self._folder(project, key)
        with self._lock:
            last = self._begun.get(project)
            if last is not None and last != key:
                self._stop(project, last)
            if all(is_complete(folder, stage) for stage in STAGES):
                self._begun[project] = key
                return key
            if self._tasks.state(self._task(project, key))["state"] == "none":
                remove_unfinished(folder)  # of a server that was killed
                self._keep(project, key)
                folder.mkdir(parents=True, exist_ok=True)
                self._tasks.start(self._task(project, key), look, project / EXPERIMENT, folder)
            self._begun[project] = key
        return key

    def state(self, project: Path) -> dict[str, str]:
        """The ``key`` of the inputs, ``signals`` and ``findings``, last ``line`` and ``error``.

        Both stages are none, running, ready or failed.
        """
        key = look_key(project / EXPERIMENT)
        folder = self._folder(project, key)
        task = self._tasks.state(self._task(project, key))
        found: dict[str, str] = {"key": key}
        for stage in STAGES:
            state: Stage = "none"
            if is_complete(folder, stage):
                state = "ready"
            elif task["state"] in ("running", "failed"):
                state = "running" if task["state"] == "running" else "failed"
            found[stage] = state
        return found | {"line": task["line"], "error": task["error"]}

    def folder(self, project: Path) -> Path:
        """Where the look at the present inputs is, once it is there."""
        return self._folder(project, look_key(project / EXPERIMENT))

    def close(self, project: Path) -> None:
        """Stop a look that is under way, before the project is renamed or removed."""
        with self._lock:
            key = self._begun.pop(project, None)
            if key is not None:
                self._stop(project, key)

    def _stop(self, project: Path, key: str) -> None:
        """Stop a look; a stage that is not complete is removed."""
        self._tasks.stop(self._task(project, key))
        remove_unfinished(self._folder(project, key))

    def _keep(self, project: Path, key: str) -> None:
        """Remove the looks that are older than the last ones."""
        others = [p for p in self._folder(project, key).parent.glob("*") if p.name != key]
        newest = sorted(others, key=lambda p: p.stat().st_mtime_ns, reverse=True)
        for folder in newest[KEPT - 1 :]:
            shutil.rmtree(folder, ignore_errors=True)

    @staticmethod
    def _folder(project: Path, key: str) -> Path:
        return project / HIDDEN / "looks" / key

    @staticmethod
    def _task(project: Path, key: str) -> str:
        return f"look {project} {key}"


#: Most files of a pattern or a bag that are looked at.
_MAX_FILES = 2000

#: Longer texts are no paths, in characters.
_MAX_LENGTH = 1000


def named_files(folder: Path, content: Mapping[str, Any]) -> list[Path]:
    """Files that any value of an experiment file names, with designs beside them, in order.

    Args:
        folder: of the experiment file.
        content: its tables.
    """
    named: set[Path] = set()
    for value in _texts(content):
        if len(value) > _MAX_LENGTH or "\0" in value:
            continue
        with suppress(OSError, ValueError):
            path = folder / value
            if any(c in value for c in "*?"):
                named |= {Path(p) for p in glob.glob(str(path))[:_MAX_FILES]}
            elif path.is_dir():
                named |= set(sorted(path.iterdir())[:_MAX_FILES])
            elif path.is_file():
                named |= {path, path.parent / DESIGN_FILE}
    return sorted(path for path in named if path.exists())


def _texts(value: Any) -> Iterator[str]:
    """Every text in a value."""
    if isinstance(value, str):
        yield value
    elif isinstance(value, (dict, list)):
        for inner in value.values() if isinstance(value, dict) else value:
            yield from _texts(inner)
