"""One run from its command to its outcome.

It is started as ``python -m pivident.app.studio.supervisor STATE_FOLDER``.

It has a session of its own, so that it goes on when the server ends. It starts the command in a
process group of its own, keeps what it says, ends it when somebody has left word, and writes the
outcome last. While it lives it holds the lock of the run; on Linux the command ends with it.
"""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from threading import Thread
from typing import Any, BinaryIO

import tomlkit

from pivident.app.studio.output import KeptStream, last_line, shown
from pivident.app.studio.projects import EXPERIMENT
from pivident.app.studio.run_folder import (
    ACCOUNT,
    OUTPUT,
    RunFolder,
    read_object,
    take,
    write_whole,
)
from pivident.foundation.errors import PividentError
from pivident.foundation.files import atomic_folder, clear_up
from pivident.foundation.text.plain_values import write_json


def with_title(text: str, title: str) -> str:
    """The text with a title for the report, where it has none: that of a hidden copy would be odd.

    The schema of the file is not asked, which takes longer to import than a supervisor to start.

    Args:
        text: of the experiment file.
        title: name of the project.

    Returns:
        The text; as it is where it cannot be read, which the command then says.
    """
    named = {"title": title.replace("_", " ")}
    try:
        content, document = tomlkit.parse(text).unwrap(), tomlkit.parse(text)
        document.setdefault("output", tomlkit.table()).setdefault("title", named["title"])
        titled = tomlkit.dumps(document)
        wanted = content | {"output": named | content.get("output", {})}
        return titled if tomlkit.parse(titled).unwrap() == wanted else text
    except (tomlkit.exceptions.TOMLKitError, AttributeError, TypeError, ValueError):
        return text


#: What an identification says of the file that it has read, in its verdict and its page.
VERDICT, REPORT = "verdict.json", "report.html"

#: Exit codes of commands that have done what was asked, with reservations or without.
DONE_CODES = (0, 3, 4)

#: From being asked to stop to being killed [s], and how often it is looked for word to stop [s].
GRACE, PAUSE = 10.0, 0.1

#: For how long a full disk may hide the outcome [s].
PATIENCE = 60.0

#: Processes that a command has left behind may hold its output open so long [s].
LEFT_BEHIND = 2.0


def supervise(run: RunFolder) -> None:
    """Run the command of a run, unless another supervisor has it or it has ended."""
    lock = take(run.state / "lock", patience=2.0)
    if lock is None or run.outcome() or not (record := run.record()):
        return
    if run.is_to_stop:
        run.finish("cancelled", message="cancelled before it began")
        return
    try:
        run.write_started()
        ended = _ended(run, record, lock.handle)
    except (OSError, PividentError) as error:
        ended = {"state": "failed", "code": None, "message": _in_words(error)}
    except Exception as error:
        text = f"unexpected {type(error).__name__}: {error}; this is a bug in pivident"
        ended = {"state": "failed", "code": None, "message": text}
    _patiently(lambda: run.finish(**ended))


def _ended(run: RunFolder, record: dict[str, Any], lock: int) -> dict[str, Any]:
    """Run the command and keep what belongs to its results; state, exit code and message."""
    results = run.project / str(record["results"])
    _begin_anew(run, results)
    streams = [KeptStream(run.state / name) for name in ("stdout", "stderr")]
    process = _command(run, record, lock)
    readers = [
        Thread(target=_keep, args=(pipe, stream), daemon=True)
        for pipe, stream in zip((process.stdout, process.stderr), streams, strict=True)
    ]
    for reader in readers:
        reader.start()
    code = _wait(process, run)
    _hear_out(readers, process)
    for stream in streams:
        stream.close()
    clear_up(results)  # what a command left that had to be killed
    ended = _judged(code, run.is_to_stop, results.is_dir(), streams[1].end)
    if trouble := next((s.trouble for s in streams if s.trouble), ""):
        lost = f"not all of its output could be kept: {trouble}; free some space"
        ended["message"] = "; ".join(filter(None, (ended["message"], lost)))
    if ended["state"] == "done":
        try:
            _add_to_results(run, record, ended, results)
        except (OSError, PividentError) as error:
            ended["message"] = "; ".join(filter(None, (ended["message"], _in_words(error))))
    return ended


def _judged(code: int, stopped: bool, has_results: bool, errors: str) -> dict[str, Any]:
    """How a command ended, by its exit code, by whether it was to stop, and by what it has written.

    One that was asked to stop and ends with 0 has finished, or written the best so far. Where one
    of several methods fails, the results of the others are there.
    """
    said = "" if code == 0 else last_line(errors)
    if stopped and code not in DONE_CODES:
        how = "cancelled" if code >= 0 else "cancelled; it did not end by itself and was killed"
        return {"state": "cancelled", "code": code, "message": how}
    if code < 0:
        name = signal.Signals(-code).name if -code in set(signal.Signals) else str(-code)
        said = f"the command was ended by {name}"
        if name == "SIGKILL":
            said += ": the memory may not have sufficed; close other programs or use less data"
    state = "done" if code in DONE_CODES or (code > 0 and has_results) else "failed"
    return {"state": state, "code": code, "message": said}


def _begin_anew(run: RunFolder, results: Path) -> None:
    """Remove what an attempt has left that was killed, and write what the command reads."""
    clear_up(results)
    if results.is_dir():
        shutil.rmtree(results)
    (run.state / "progress").unlink(missing_ok=True)
    if (run.state / EXPERIMENT).exists():
        text = (run.state / EXPERIMENT).read_text(encoding="utf-8", errors="surrogateescape")
        write_whole(run.copy, with_title(text, f"{run.project.name}, run {run.id}"))


def _command(run: RunFolder, record: dict[str, Any], lock: int) -> subprocess.Popen[bytes]:
    """Start the command; nothing in the project's folder is imported in place of a library."""
    argv = [run.copy.name if token == EXPERIMENT else str(token) for token in record["argv"]]
    environment = os.environ | {
        "PIVIDENT_PROGRESS": str(run.state / "progress"),
        "PYTHONIOENCODING": "utf-8",
        "PYTHONSAFEPATH": "1",
    }
    options: dict[str, Any] = {}
    if sys.platform == "win32":
        options["creationflags"] = subprocess.CREATE_NEW_PROCESS_GROUP
    else:
        # A server in the background may ignore Ctrl-C, and its children with it.
        signal.signal(signal.SIGINT, signal.SIG_DFL)
        options["process_group"] = 0
        if sys.platform == "linux":
            options["preexec_fn"] = _ends_with(os.getpid())
        else:
            options["pass_fds"] = (lock,)  # nobody begins again before this one has ended
    return subprocess.Popen(
        [sys.executable, "-P", "-m", "pivident", *argv],
        cwd=run.project,
        env=environment,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        **options,
    )


def _ends_with(parent: int) -> Callable[[], None]:
    """What a new process calls to be killed when its parent is; ``prctl(PR_SET_PDEATHSIG, …)``."""
    from ctypes import CDLL

    library = CDLL(None)

    def ask() -> None:
        library.prctl(1, signal.SIGKILL)
        if os.getppid() != parent:
            os._exit(1)

    return ask


def _keep(pipe: BinaryIO, stream: KeptStream) -> None:
    """Move all that a process says into a file."""
    with suppress(OSError, ValueError):
        while chunk := os.read(pipe.fileno(), 65_536):
            stream.feed(chunk)


def _wait(process: subprocess.Popen[bytes], run: RunFolder) -> int:
    """Exit code of a process, which is interrupted once somebody wants it to end."""
    killed_at: float | None = None
    while True:
        with suppress(subprocess.TimeoutExpired):
            return process.wait(PAUSE)
        if killed_at is None and run.is_to_stop:
            killed_at = time.monotonic() + GRACE
            _send(process, "SIGINT")
        elif killed_at is not None and time.monotonic() > killed_at:
            _send(process, "SIGKILL")


def _send(process: subprocess.Popen[bytes], name: str) -> None:
    """Send a signal to the process and all that it has started; Windows only ends processes."""
    with suppress(OSError):
        if sys.platform == "win32":
            process.terminate()
        else:
            os.killpg(process.pid, getattr(signal, name))


def _hear_out(readers: Sequence[Thread], process: subprocess.Popen[bytes]) -> None:
    """Wait for the end of both streams; who else holds them open was left behind and is ended."""
    for patient in (True, False):
        for reader in readers:
            reader.join(LEFT_BEHIND)
        if patient and any(reader.is_alive() for reader in readers):
            _send(process, "SIGKILL")


def _add_to_results(
    run: RunFolder, record: dict[str, Any], ended: dict[str, Any], results: Path
) -> None:
    """Add the experiment that was run, what was printed, and the account of the run."""
    results.parent.mkdir(exist_ok=True)
    with atomic_folder(results) as build:
        if (run.state / EXPERIMENT).exists():
            (build / EXPERIMENT).write_bytes((run.state / EXPERIMENT).read_bytes())
            _name_original(run, record, results, build)
        said = shown(run.state / "stdout").replace(run.copy.name, EXPERIMENT)
        (build / OUTPUT).write_text(said, encoding="utf-8")
        write_json(build / ACCOUNT, record | run.started() | ended)


def _name_original(run: RunFolder, record: dict[str, Any], results: Path, build: Path) -> None:
    """Verdict and report about the experiment file itself, not about the copy that was read.

    The verdict remembers what was said against the run.
    """
    for name in (VERDICT, REPORT):
        if (results / name).is_file():
            text = (results / name).read_text(encoding="utf-8")
            (build / name).write_text(text.replace(run.copy.name, EXPERIMENT), encoding="utf-8")
    if verdict := read_object(build / VERDICT):
        about = {key: record.get(key, []) for key in ("experiment", "in_spite_of")}
        write_json(build / VERDICT, verdict | about)


def _in_words(error: OSError | PividentError) -> str:
    """An error of the supervisor itself, with the next step."""
    if isinstance(error, PividentError):
        return str(error)
    return (
        f"{error.filename or 'the run'}: {error.strerror or error}; free some space or change the "
        "permissions of the project's folder, and run it again"
    )


def _patiently(write: Callable[[], None]) -> None:
    """Try to write until the disk has space again, but not for ever."""
    deadline = time.monotonic() + PATIENCE
    while True:
        try:
            return write()
        except OSError:
            if time.monotonic() > deadline:
                raise
            time.sleep(1.0)


if __name__ == "__main__":
    supervise(RunFolder.at(Path(sys.argv[1]).absolute()))
