"""The current look at each project: begun when its inputs change, the older one stopped."""

from __future__ import annotations

import shutil
import threading
from pathlib import Path
from typing import Literal

from pivident.studio.look import STAGES, is_complete, look, look_key, remove_unfinished
from pivident.studio.projects import EXPERIMENT, HIDDEN
from pivident.studio.tasks import Tasks

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
