"""Work in processes of its own: the server never waits, what is stale is killed, memory goes back.

On systems that fork, a process without threads that has imported what tasks need is forked for
each (`multiprocessing`'s fork server), so that a task begins within milliseconds; elsewhere each
imports by itself.
"""

from __future__ import annotations

import multiprocessing
import os
import threading
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing.connection import Connection, wait
from typing import Any, Literal

from pivident.foundation.errors import PividentError

State = Literal["none", "running", "done", "failed"]

#: Modules that the process imports from which tasks are forked.
PRELOADED = ("pivident.app.studio.preloaded",)

#: What a task says last: that it is done, or why not.
_LINE, _ERROR, _DONE = "line", "error", "done"


def _context(preloaded: Sequence[str]) -> Any:
    """How processes are started here."""
    if "forkserver" not in multiprocessing.get_all_start_methods():
        return multiprocessing.get_context("spawn")
    context = multiprocessing.get_context("forkserver")
    from multiprocessing import forkserver

    context.set_forkserver_preload([*PRELOADED, *preloaded])
    forkserver.ensure_running()  # it imports while nobody waits
    return context


@dataclass(eq=False)
class _Task:
    """One task, as its watcher sees it."""

    process: Any
    watcher: threading.Thread | None = None
    state: State = "running"
    line: str = ""
    error: str = ""


class Tasks:
    """Tasks by their keys; the methods may be called from any thread.

    Args:
        preloaded: more modules to import once for all tasks, such as those of the script that has
            been started: each task imports it by itself otherwise, as `multiprocessing` does.
    """

    def __init__(self, preloaded: Sequence[str] = ()) -> None:
        self._context = _context(preloaded)
        self._tasks: dict[str, _Task] = {}
        self._lock = threading.RLock()

    def start(self, key: str, function: Callable[..., None], *arguments: Any) -> None:
        """Call ``function(*arguments, say)`` in a process of its own; one of that key is stopped.

        Args:
            key: name of the task.
            function: of a module; ``say`` is called with one line at each stage.
            arguments: plain values and paths.
        """
        with self._lock:
            self.stop(key)
            ours, theirs = self._context.Pipe(duplex=False)
            process = self._context.Process(
                target=_run, args=(theirs, function, arguments), daemon=True
            )
            process.start()
            theirs.close()
            task = self._tasks[key] = _Task(process)
            task.watcher = threading.Thread(target=_watch, args=(task, ours), daemon=True)
            task.watcher.start()

    def state(self, key: str) -> dict[str, str]:
        """Its ``state`` (none, running, done, failed), last ``line`` and ``error``."""
        task = self._tasks.get(key)
        if task is None:
            return {"state": "none", "line": "", "error": ""}
        return {"state": task.state, "line": task.line, "error": task.error}

    def stop(self, key: str) -> None:
        """Kill a task and forget it; when this returns, it writes no more."""
        with self._lock:
            task = self._tasks.pop(key, None)
        if task is not None:
            with suppress(ValueError, OSError):  # it has ended and is closed
                task.process.kill()
            if task.watcher is not None:
                task.watcher.join()

    def close(self) -> None:
        """Stop all tasks."""
        for key in list(self._tasks):
            self.stop(key)


def _watch(task: _Task, heard: Connection) -> None:
    """Hear what a task says until its process has ended."""
    said: tuple[str, str] = ("", "")
    with suppress(EOFError, OSError):
        while True:
            said = heard.recv()
            if said[0] == _LINE:
                task.line = said[1]
    heard.close()
    task.process.join()
    if said[0] == _DONE:
        task.state = "done"
    else:
        task.error = said[1] if said[0] == _ERROR else _ended(task.process.exitcode)
        task.state = "failed"
    task.process.close()


def _ended(code: int | None) -> str:
    """Why a process ended that has not said so."""
    if code is not None and code < 0:
        return f"the process was stopped by signal {-code}; it may have needed too much memory"
    return f"the process ended with code {code}"


def _run(heard: Connection, function: Callable[..., None], arguments: tuple[Any, ...]) -> None:
    """The process of a task; it ends when the server does."""
    threading.Thread(target=_end_with_parent, daemon=True).start()

    def say(line: str) -> None:
        heard.send((_LINE, str(line)))

    try:
        function(*arguments, say)
    except PividentError as error:
        heard.send((_ERROR, " ".join(str(error).split())))
    except MemoryError:
        heard.send((_ERROR, "there is not enough memory for this"))
    except Exception as error:  # whatever it is, the page shows it
        heard.send((_ERROR, f"{type(error).__name__}: {error}"))
    else:
        heard.send((_DONE, ""))


def _end_with_parent() -> None:
    """Nobody waits for the result when the server has gone."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        wait([parent.sentinel])
        os._exit(1)
