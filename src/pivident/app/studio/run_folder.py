"""What is on disk of one run: what was asked, whether it goes on, and how it ended.

    PROJECT/.pivident-studio/runs/001/
        run.json          step, arguments, command line: written once, when the run is added
        experiment.toml   the experiment file at that time
        reserve           space for the files below, on a disk that is full by then
        lock              held by the supervisor while it lives
        started.json      when, and at which attempt
        stop              somebody wants it to end
        progress, stdout, stderr
        outcome.json      how it ended, written last

A run is waiting before ``started.json``, runs while the lock is held, and has ended with
``outcome.json``; one that was started, whose lock is free and that has no outcome was killed.

Locks on files: who holds one is alive, since the system takes it away when the process ends.
"""

from __future__ import annotations

import json
import os
import re
import shutil
import sys
import time
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Literal

from pivident.app.studio.projects import EXPERIMENT, HIDDEN, RESULTS
from pivident.foundation.errors import PividentError
from pivident.foundation.text.plain_values import strict_json

#: Files that the supervisor adds to the results of a run.
ACCOUNT, OUTPUT = "run.json", "output.txt"

#: Kept free for started.json and outcome.json [bytes].
RESERVE = 32_768

Stage = Literal["waiting", "running", "killed", "ended"]

_RUN = re.compile(r"[0-9]{3,6}")
_RESULT = re.compile(r"([0-9]{3,6})-([a-z]+)")


class RunError(PividentError, RuntimeError):
    """A run that cannot be added, found or removed."""


def iso(seconds: float) -> str:
    """A time since 1970 [s] as ISO 8601, UTC."""
    text = datetime.fromtimestamp(seconds, UTC).isoformat(timespec="microseconds")
    return text.replace("+00:00", "Z")


@dataclass(frozen=True)
class RunFolder:
    """The files of one run.

    Attributes:
        project: folder of the project.
        id: number of the run, ``001``.
    """

    project: Path
    id: str

    @classmethod
    def of(cls, project: Path, run: str) -> RunFolder:
        """The files of a run that somebody names.

        Raises:
            RunError: this is no number of a run, or there is no such run.
        """
        if not _RUN.fullmatch(run) or run not in run_numbers(project):
            raise RunError(f"{project.name} has no run {run!r}", advice="reload the list of runs")
        return cls(project, run)

    @classmethod
    def at(cls, state: Path) -> RunFolder:
        """The files of the run whose state is in this folder."""
        return cls(state.parents[2], state.name)

    @property
    def state(self) -> Path:
        """Folder of what is known of the run."""
        return self.project / HIDDEN / "runs" / self.id

    @property
    def copy(self) -> Path:
        """What the command reads: beside the experiment file, so that relative paths hold."""
        return self.project / f".experiment-{self.id}.toml"

    @property
    def results(self) -> Path:
        """Folder of its results, or where they would be."""
        return self.project / RESULTS / result_folders(self.project).get(self.id, ["none"])[0]

    def record(self) -> dict[str, Any]:
        """What was asked; empty where the run is not, or not yet, complete."""
        return read_object(self.state / "run.json")

    def started(self) -> dict[str, Any]:
        """When it was started and at which attempt; empty before."""
        return read_object(self.state / "started.json")

    def outcome(self) -> dict[str, Any]:
        """How it ended; empty before."""
        return read_object(self.state / "outcome.json")

    def stage(self) -> Stage:
        """Where the run is; the order of the questions matters while the supervisor acts."""
        if self.outcome():
            return "ended"
        started = self.started()
        if is_held(self.state / "lock"):
            return "running"
        if not started:
            return "waiting"
        return "ended" if self.outcome() else "killed"

    def write_started(self) -> int:
        """Note another attempt; returns its number."""
        attempt = int(self.started().get("attempt", 0)) + 1
        self._write("started.json", {"started": iso(time.time()), "attempt": attempt})
        return attempt

    def finish(self, state: str, code: int | None = None, message: str = "") -> None:
        """Write how the run ended, whole or not at all, and remove what only a live one needs.

        Raises:
            OSError: the disk is full in spite of the space that was kept for this.
        """
        self.copy.unlink(missing_ok=True)
        content = {"state": state, "code": code, "message": message, "ended": iso(time.time())}
        self._write("outcome.json", content)
        (self.state / "reserve").unlink(missing_ok=True)

    def ask_to_stop(self) -> None:
        """Leave word for the supervisor, or for whoever would start the run."""
        (self.state / "reserve").unlink(missing_ok=True)
        (self.state / "stop").touch()

    @property
    def is_to_stop(self) -> bool:
        """Whether somebody wants the run to end."""
        return (self.state / "stop").exists()

    def remove(self) -> None:
        """Remove the run and its results."""
        for name in result_folders(self.project).get(self.id, []):
            shutil.rmtree(self.project / RESULTS / name)
        shutil.rmtree(self.state, ignore_errors=True)
        self.copy.unlink(missing_ok=True)

    def _write(self, name: str, content: Mapping[str, Any]) -> None:
        """Write a small file; on a full disk into the space that was kept for it."""
        try:
            write_whole(self.state / name, strict_json(content))
        except OSError:
            (self.state / "reserve").unlink(missing_ok=True)
            write_whole(self.state / name, strict_json(content))


def new_run(project: Path, record: Mapping[str, Any], experiment: bytes | None) -> RunFolder:
    """Write down a run under the next free number.

    Args:
        project: folder of the project.
        record: what was asked; may hold ``{id}`` in texts where the number belongs.
        experiment: content of the experiment file, or None.

    Raises:
        RunError: the state cannot be written, on a full disk for instance.
    """
    runs = project / HIDDEN / "runs"
    run: RunFolder | None = None
    for folder in (project / HIDDEN, project / RESULTS):
        if folder.is_symlink():
            raise RunError(f"{folder} is a link", advice="put a folder in its place")
    try:
        runs.mkdir(parents=True, exist_ok=True)
        while run is None:
            number = max([*map(int, run_numbers(project)), _last_number(runs)]) + 1
            with suppress(FileExistsError):  # another server was faster
                (runs / f"{number:03d}").mkdir()
                run = RunFolder(project, f"{number:03d}")
        write_whole(runs / "last", run.id)
        (run.state / "reserve").write_bytes(bytes(RESERVE))
        (run.state / "lock").touch()
        if experiment is not None:
            (run.state / EXPERIMENT).write_bytes(experiment)
        content = {"id": run.id, **record, "created": iso(time.time())}
        write_whole(run.state / "run.json", strict_json(content).replace("{id}", run.id))
    except OSError as error:
        if run is not None:
            shutil.rmtree(run.state, ignore_errors=True)
        raise RunError(
            f"the run cannot be written to {runs}: {error.strerror or error}",
            advice="free some space or change the permissions of the folder",
        ) from error
    return run


def run_numbers(project: Path) -> list[str]:
    """Numbers of all runs of a project in their order, also where only results are left."""
    try:
        names = os.listdir(project / HIDDEN / "runs")
    except OSError:
        names = []
    found = {name for name in names if _RUN.fullmatch(name)} | set(result_folders(project))
    return sorted(found, key=int)


def result_folders(project: Path) -> dict[str, list[str]]:
    """Names of the folders of results by the numbers of their runs."""
    found: dict[str, list[str]] = {}
    for name, number in _named_results(project):
        found.setdefault(number, []).append(name)
    return found


def _named_results(project: Path) -> Iterator[tuple[str, str]]:
    with suppress(OSError), os.scandir(project / RESULTS) as entries:
        for entry in entries:
            named = _RESULT.fullmatch(entry.name)
            if named and entry.is_dir(follow_symlinks=False):
                yield entry.name, named[1]


def write_whole(path: Path, text: str) -> None:
    """Write a file so that a reader finds all of it, or what was there before.

    Raises:
        OSError: it cannot be written; nothing is left of it.
    """
    build = path.with_name(f"{path.name}.{os.getpid()}.new")
    try:
        build.write_text(text, encoding="utf-8", errors="backslashreplace")
        os.replace(build, path)
    except OSError:
        build.unlink(missing_ok=True)
        raise


def _last_number(runs: Path) -> int:
    """Number of the run that was added last, even if it has been removed since."""
    try:
        return int((runs / "last").read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return 0


def read_object(path: Path) -> dict[str, Any]:
    """A JSON object that was written whole; empty where there is none."""
    try:
        content = json.loads(path.read_bytes())
    except (OSError, ValueError):
        return {}
    return content if isinstance(content, dict) else {}


#: Between two tries to take a lock that somebody may only be testing [s].
PAUSE = 0.02


class Lock:
    """A lock that this process holds until it ends or releases it.

    Attributes:
        handle: of the locked file; a child process that inherits it holds the lock too.
    """

    def __init__(self, handle: int) -> None:
        self.handle = handle

    def release(self) -> None:
        """Let others have it."""
        with suppress(OSError):
            os.close(self.handle)


def take(path: Path, patience: float = 0.0) -> Lock | None:
    """Lock a file, which is created where there is none.

    Args:
        path: the file.
        patience: how long to try [s]; whoever asks `is_held` has the lock for a moment.

    Returns:
        The lock, or None where another process holds it.

    Raises:
        OSError: the file cannot be opened.
    """
    deadline = time.monotonic() + patience
    while True:
        handle = os.open(path, os.O_RDWR | os.O_CREAT, 0o600)
        if _locked(handle):
            return Lock(handle)
        os.close(handle)
        if time.monotonic() >= deadline:
            return None
        time.sleep(PAUSE)


def is_held(path: Path) -> bool:
    """Whether some process holds the lock of a file."""
    try:
        handle = os.open(path, os.O_RDWR)
    except OSError:
        return False
    try:
        return not _locked(handle)
    finally:
        os.close(handle)


if sys.platform == "win32":
    import msvcrt

    def _locked(handle: int) -> bool:
        """Lock the first byte of an open file, or say that another has it."""
        try:
            msvcrt.locking(handle, msvcrt.LK_NBLCK, 1)
        except OSError:
            return False
        return True

else:
    import fcntl

    def _locked(handle: int) -> bool:
        """Lock an open file, or say that another has it."""
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            return False
        return True
