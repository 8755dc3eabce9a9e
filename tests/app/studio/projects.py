"""Projects whose command is a script of a few lines, and waiting for what their runs do."""

import os
import time
from pathlib import Path

QUICK = Path(__file__).parent / "quick_command"

EXPERIMENT = 'robot = "planar_2r"\n\n[recording]\nfiles = "log.csv"\n'

#: Longest that a run of these tests takes on a busy machine [s].
PATIENCE = 120.0

#: Writes results as a command does, and notes that it has run.
WRITES = """
import os, sys
from pathlib import Path
with open("ran", "a") as file:
    file.write(" ".join(argv) + "\\n")
out = Path(argv[argv.index("--out") + 1])
out.mkdir(parents=True)
(out / "identification.json").write_text("{}")
"""

#: Goes on until the project has a file ``go``.
WAITS = """
import time
open("begun", "a").close()
while not os.path.exists("go"):
    time.sleep(0.02)
"""


def with_quick_commands(monkeypatch) -> None:
    """Let commands of pivident in projects with a script run that in their place."""
    path = os.pathsep.join(filter(None, (str(QUICK), os.environ.get("PYTHONPATH"))))
    monkeypatch.setenv("PYTHONPATH", path)


def make_project(folder: Path, script: str = WRITES) -> Path:
    folder.mkdir(parents=True)
    (folder / "experiment.toml").write_text(EXPERIMENT)
    (folder / "script.py").write_text(script)
    return folder.resolve()


def wait_for(condition, what: str = ""):
    """The first value of a condition that is true."""
    deadline = time.monotonic() + PATIENCE
    while not (found := condition()):
        assert time.monotonic() < deadline, f"waited too long for {what or condition}"
        time.sleep(0.02)
    return found


def entry(runs, project: Path, run: str) -> dict:
    return next(e for e in runs.listed(project) if e["id"] == run)


def ended(runs, project: Path, run: str) -> dict:
    """The run as it is listed, once it has ended."""
    return wait_for(lambda: (e := entry(runs, project, run))["ended"] and e, f"the end of {run}")
