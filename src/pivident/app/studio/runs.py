"""The queue of runs: what waits is started, what goes on is watched, what was killed is run again.

Nothing is remembered that is not on disk: each look reads the pending runs of all known projects,
so that a server that starts, or a second one, sees what another has left.
"""

from __future__ import annotations

import hashlib
import shlex
import subprocess
import sys
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from threading import Condition, Thread
from typing import Any

from pivident.app.studio.projects import EXPERIMENT, RESULTS
from pivident.app.studio.run_folder import RunError, RunFolder, new_run, run_numbers, take
from pivident.app.studio.run_listing import RunListing
from pivident.app.studio.steps import step_named
from pivident.foundation.text.plain_values import plain

#: Between two looks while something waits or runs, and otherwise [s].
BUSY, IDLE = 0.2, 2.0

#: A run that was killed is started once more.
MAX_ATTEMPTS = 2

#: How often a supervisor is started that ends before it has begun.
MAX_STARTS = 5

#: Largest experiment file [bytes].
MAX_BYTES = 4_000_000

#: Messages of runs that were killed at every attempt, and that could not be started.
KILLED = (
    "the run was killed from outside, twice: the memory may not have sufficed, or the computer was "
    "shut down; run it again"
)
NOT_STARTED = "the run could not be started; look at the space on the disk and run it again"

#: Supervisors that go on without the server that started them.
_left: list[subprocess.Popen[bytes]] = []


class Runs:
    """Runs of projects, in the order in which they were added; safe to use from several threads.

    Args:
        at_once: how many run at the same time.
    """

    def __init__(self, at_once: int = 1) -> None:
        self._at_once = at_once
        self._changed = Condition()
        self._projects: dict[Path, set[str]] = {}  # and their runs that are known to have ended
        self._supervisors: dict[RunFolder, subprocess.Popen[bytes]] = {}
        self._starts: Counter[RunFolder] = Counter()
        self._listing = RunListing()
        self._closed = False
        self._watcher = Thread(target=self._watch, name="pivident-runs", daemon=True)
        self._watcher.start()

    def add(
        self,
        project: Path,
        step: str,
        arguments: Mapping[str, Any],
        in_spite_of: Sequence[str] = (),
    ) -> str:
        """Queue a step with the experiment file as it is now.

        Args:
            project: folder of the project.
            step: name of one of `pivident.app.studio.steps.STEPS`.
            arguments: of the step.
            in_spite_of: what was said against it, which its results remember.

        Returns:
            The number of the run, ``001``.

        Raises:
            StepError: the step does not exist or does not take these arguments.
            RunError: the run cannot be written.
        """
        project, chosen = project.resolve(), step_named(step)
        out = f"{RESULTS}/{{id}}-{step}"
        argv = chosen.command(project, arguments, out)
        experiment = _content(project / EXPERIMENT) if EXPERIMENT in argv else None
        record = {
            "step": step,
            "title": chosen.title,
            "arguments": plain(dict(arguments)),
            "argv": argv,
            "command": shlex.join(["pivident", *argv]).replace(f"'{out}'", out),
            "results": out,
            "in_spite_of": list(in_spite_of),
            "experiment": "" if experiment is None else hashlib.sha256(experiment).hexdigest(),
        }
        with self._changed:
            run = new_run(project, record, experiment)
            self._projects.setdefault(project, set())
            self._changed.notify_all()
        return run.id

    def listed(self, project: Path) -> list[dict[str, Any]]:
        """Runs of a project as plain values, newest first."""
        with self._changed:
            return self._listing.of(project.resolve())

    def cancel(self, project: Path, run: str) -> None:
        """End a run that waits or goes on; one that has ended stays as it is.

        The command is interrupted as by Ctrl-C, and killed if it has not ended after ten seconds.

        Raises:
            RunError: there is no such run.
        """
        with self._changed:
            folder = RunFolder.of(project.resolve(), run)
            self._projects.setdefault(folder.project, set())
            if not folder.outcome() and folder.record():
                _written(folder, folder.ask_to_stop)
                self._end_without_supervisor(folder)
            self._changed.notify_all()

    def remove(self, project: Path, run: str) -> None:
        """Remove a run that has ended, with its results.

        Raises:
            RunError: there is no such run, or it has not ended.
        """
        with self._changed:
            folder = RunFolder.of(project.resolve(), run)
            if folder.record() and not folder.outcome():
                raise RunError(
                    f"run {run} of {project.name} has not ended", advice="cancel it first"
                )
            _written(folder, folder.remove)
            self._listing.forget(folder)

    def resume(self, projects: Iterable[Path]) -> None:
        """Watch projects: their runs that go on, wait, or were killed."""
        with self._changed:
            for project in projects:
                self._projects.setdefault(project.resolve(), set())
            self._changed.notify_all()

    def close(self) -> None:
        """Stop watching; what runs goes on, what waits stays in the queue."""
        with self._changed:
            self._closed = True
            self._changed.notify_all()
        self._watcher.join()
        _left.extend(self._supervisors.values())
        _left[:] = [process for process in _left if process.poll() is None]

    def _watch(self) -> None:
        with self._changed:
            while not self._closed:
                self._changed.wait(BUSY if self._look() else IDLE)

    def _look(self) -> bool:
        """Start what has its turn; whether anything waits or runs."""
        for run in [run for run, p in self._supervisors.items() if p.poll() is not None]:
            del self._supervisors[run]
        running, waiting = set(self._supervisors), []
        for run in self._pending():
            stage = run.stage()
            if stage == "running":
                running.add(run)
            elif stage != "ended" and run not in self._supervisors:
                if not self._end_without_supervisor(run):
                    waiting.append(run)
        waiting.sort(key=lambda run: (run.record().get("created", ""), run.project, run.id))
        for run in waiting[: max(self._at_once - len(running), 0)]:
            with suppress(OSError):  # no memory for a process: at the next look
                self._supervisors[run] = _supervisor(run)
                self._starts[run] += 1
        return bool(running or waiting)

    def _pending(self) -> list[RunFolder]:
        """Runs of all projects that have not ended."""
        found = []
        for project, ended in self._projects.items():
            for number in run_numbers(project):
                if number in ended:
                    continue
                run = RunFolder(project, number)
                if run.outcome() or not (run.state).is_dir():
                    ended.add(number)
                elif run.record():
                    found.append(run)
        return found

    def _end_without_supervisor(self, run: RunFolder) -> bool:
        """Write the outcome of a run that is to stop or failed too often; whether it was needed."""
        message = ""
        if int(run.started().get("attempt", 0)) >= MAX_ATTEMPTS:
            message = KILLED
        elif self._starts[run] >= MAX_STARTS:
            message = NOT_STARTED
        if not message and not run.is_to_stop:
            return False
        with suppress(OSError):
            lock = take(run.state / "lock")
            if lock is None:
                return False
            try:
                if run.outcome():
                    return True
                if run.is_to_stop:
                    run.finish("cancelled", message="cancelled")
                else:
                    run.finish("failed", message=message)
                return True
            finally:
                lock.release()
        return False


def _supervisor(run: RunFolder) -> subprocess.Popen[bytes]:
    """Start a run in a session of its own."""
    detached: dict[str, Any] = {"start_new_session": True}
    if sys.platform == "win32":
        detached = {
            "creationflags": subprocess.DETACHED_PROCESS | subprocess.CREATE_NEW_PROCESS_GROUP
        }
    return subprocess.Popen(
        [sys.executable, "-P", "-m", "pivident.app.studio.supervisor", str(run.state)],
        cwd=run.project,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        **detached,
    )


def _content(path: Path) -> bytes | None:
    """Content of the experiment file; None where there is none."""
    try:
        with path.open("rb") as file:
            content = file.read(MAX_BYTES + 1)
    except FileNotFoundError:
        return None
    except OSError as error:
        raise RunError(f"{path} cannot be read: {error.strerror}") from error
    if len(content) > MAX_BYTES:
        raise RunError(f"{path} has more than {MAX_BYTES} bytes, which no experiment file has")
    return content


def _written(run: RunFolder, change: Any) -> None:
    """Change files of a run; on failure in words."""
    try:
        change()
    except OSError as error:
        raise RunError(
            f"run {run.id} of {run.project.name} cannot be changed: {error.strerror or error}"
        ) from error
