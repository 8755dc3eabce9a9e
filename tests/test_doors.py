"""Without the packages that nothing before them imports, a record is identified and reported."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import pivident
from tests.planar_log import write_experiment
from tests.rooms import package
from tests.test_layout import DOORS

SOURCE = Path(pivident.__file__).parent

#: A command of the command line that needs each package, if there is one.
COMMANDS = {
    "models.symbolic": ["symbolic", "planar_2r"],
    "models.export": ["export", "model.json", "--to", "c", "--out", "model.c"],
    "studies.payload": ["payload", "experiment.toml"],
    "studies.flexibility": ["flexibility", "experiment.toml"],
    "studies.collision": ["excite", "planar_2r", "--seconds", "1"],
    "studies.excitation": ["excite", "planar_2r", "--seconds", "1"],
    "studies.many": ["study", "fine", "--runs", "1"],
    "studies.paper": ["paper", "--quick"],
}


@pytest.fixture(scope="module")
def installation_without(tmp_path_factory):
    """Copies of the package, with its compiled kernels, that lack some of its packages."""

    def copied(*doors: str) -> Path:
        folder = tmp_path_factory.mktemp("without")
        left_out = {str(SOURCE.joinpath(*door.split("."))) for door in doors}

        def ignored(parent: str, names: list[str]) -> list[str]:
            return [n for n in names if f"{parent}/{n}" in left_out]

        shutil.copytree(SOURCE, folder / "pivident", ignore=ignored)
        return folder

    return copied


def run(installation: Path, folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    environment = {**os.environ, "PYTHONPATH": str(installation), "PYTHONDONTWRITEBYTECODE": "1"}
    environment.pop("PIVIDENT_DEBUG", None)
    return subprocess.run(
        [sys.executable, *arguments], cwd=folder, env=environment, capture_output=True, text=True
    )


def test_every_door_closed_at_once(installation_without, tmp_path):
    installation = installation_without(*DOORS)
    found = run(installation, tmp_path, "-c", "import pivident; print(pivident.__file__)")
    assert found.stdout.startswith(str(installation)), found.stderr
    shown = run(installation, tmp_path, "-m", "pivident", "--help")
    assert shown.returncode == 0 and "identify" in shown.stdout, shown.stderr
    write_experiment(tmp_path)
    done = run(installation, tmp_path, "-m", "pivident", "identify", "experiment.toml")
    assert done.returncode == 0, done.stderr
    files = {path.name for path in (tmp_path / "experiment-results").rglob("*")}
    assert {"report.html", "identification.json", "verdict.json"} <= files


#: Runs commands one after the other, each with a package hidden, and writes what they say.
_COMMANDS_IN_THE_CHILD = """
import contextlib, io, json, sys
import pivident
from pivident.app.cli.app import main

class AllButHidden:
    hidden = ""

    def __init__(self, finder):
        self.finder = finder

    def find_spec(self, name, path=None, target=None):
        return None if name == self.hidden else self.finder.find_spec(name, path, target)

sys.meta_path[:] = map(AllButHidden, sys.meta_path)
commands, doors = map(json.loads, sys.argv[1:])
found = {}
for door, arguments in commands.items():
    for closed in [f"pivident.{one}" for one in doors]:
        for name in [n for n in sys.modules if f"{n}.".startswith(f"{closed}.")]:
            del sys.modules[name]
        room, _, package = closed.rpartition(".")
        if room in sys.modules:
            vars(sys.modules[room]).pop(package, None)
    AllButHidden.hidden = f"pivident.{door}"
    errors = io.StringIO()
    with contextlib.redirect_stderr(errors), contextlib.redirect_stdout(io.StringIO()):
        code = main(arguments)
    found[door] = code, errors.getvalue()
print(json.dumps(found))
"""


@pytest.fixture(scope="module")
def said(tmp_path_factory):
    """Exit code and errors of each command without its package."""
    folder = tmp_path_factory.mktemp("commands")
    write_experiment(folder)
    given = json.dumps(COMMANDS), json.dumps(DOORS)
    done = run(SOURCE.parent, folder, "-c", _COMMANDS_IN_THE_CHILD, *given)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


@pytest.mark.parametrize("door", COMMANDS)
def test_a_command_names_the_package_that_was_left_out(door, said):
    code, errors = said[door]
    assert code == 1
    assert errors.startswith(f"error: this installation has no {door.rpartition('.')[2]!r}"), errors
    assert "Traceback" not in errors


def test_a_package_that_is_not_there_is_named_as_one_that_is_hidden(
    installation_without, tmp_path, said
):
    door = "models.symbolic"
    found = run(installation_without(door), tmp_path, "-m", "pivident", *COMMANDS[door])
    assert [found.returncode, found.stderr] == said[door]


def test_no_door_is_opened_before_a_command_needs_it(tmp_path):
    """So the command line, the report and notebooks do without each of them."""
    code = (
        "import sys, pivident.app.cli.workflow, pivident.app.notebook.displays; "
        "import pivident.judgement.report.builder; "
        "print(*(n for n in sys.modules if n.startswith('pivident.')))"
    )
    found = run(SOURCE.parent, tmp_path, "-c", code)
    assert found.returncode == 0, found.stderr
    opened = {package(name) for name in found.stdout.split()}
    assert {"app.cli", "judgement.report", "app.notebook"} <= opened and not opened & set(DOORS)
