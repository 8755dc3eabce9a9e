"""Commands in processes of their own that need not import NumPy, SciPy and Numba once more."""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from pathlib import Path

#: Has imported the libraries and nothing of pivident, and leaves a copy of itself to each command.
WAITING = """
import json, os, runpy, sys, traceback
import cyclopts, numba, numpy, pydantic, rich.console, rich.table, tomlkit
import scipy.interpolate, scipy.linalg, scipy.optimize, scipy.signal, scipy.special, scipy.stats

def run(words):
    try:
        if words[0] == "-c":
            sys.argv = ["-c", *words[2:]]
            exec(words[1], {"__name__": "__main__"})
        else:
            sys.argv = words[1:]
            runpy.run_module(words[1], run_name="__main__", alter_sys=True)
    except SystemExit as end:
        if isinstance(end.code, str):
            print(end.code, file=sys.stderr)
        return end.code if isinstance(end.code, int) else int(end.code is not None)
    except BaseException:
        traceback.print_exc()
        return 1
    return 0

answers = os.fdopen(os.dup(1), "w")
for line in sys.stdin:
    words, place, streams = json.loads(line)
    if (child := os.fork()) == 0:
        os.chdir(place)
        for number, stream in enumerate(streams, start=1):
            os.dup2(os.open(stream, os.O_WRONLY | os.O_CREAT), number)
        code = run(words)
        sys.stdout.flush()
        os._exit(code)
    print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), file=answers, flush=True)
"""


class ForkedPython:
    """``python -m …`` and ``python -c …`` in an environment.

    Args:
        environment: of all commands.
    """

    def __init__(self, environment: dict[str, str]) -> None:
        self._waiting = subprocess.Popen(
            [sys.executable, "-c", WAITING],
            env=environment, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
        )  # fmt: skip

    def run(self, *words: str, cwd: Path) -> subprocess.CompletedProcess[str]:
        """What a command ends with and prints, as `subprocess.run` returns it."""
        with tempfile.TemporaryDirectory() as folder:
            streams = [Path(folder, name) for name in ("stdout", "stderr")]
            request = [words, str(cwd), [str(stream) for stream in streams]]
            self._waiting.stdin.write(json.dumps(request) + "\n")
            self._waiting.stdin.flush()
            code = int(self._waiting.stdout.readline())
            said = [stream.read_text(encoding="utf-8") for stream in streams]
        return subprocess.CompletedProcess(words, code, *said)

    def close(self) -> None:
        """End what waits."""
        self._waiting.communicate()
