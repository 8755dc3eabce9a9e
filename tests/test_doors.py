"""Without the packages that nothing before them imports, a record is identified and reported."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import pivident
from tests.planar_log import write_experiment
from tests.test_layout import DOORS

SOURCE = Path(pivident.__file__).parent

#: A command of the command line that needs each package, if there is one.
COMMANDS = {
    "symbolic": ["symbolic", "planar_2r"],
    "export": ["export", "model.json", "--to", "c", "--out", "model.c"],
    "payload": ["payload", "experiment.toml"],
    "flexibility": ["flexibility", "experiment.toml"],
    "collision": ["excite", "planar_2r", "--seconds", "1"],
    "excitation": ["excite", "planar_2r", "--seconds", "1"],
    "many": ["study", "fine", "--runs", "1"],
    "paper": ["paper", "--quick"],
}


@pytest.fixture(scope="module")
def installation_without(tmp_path_factory):
    """Copies of the package, with its compiled kernels, that lack some of its packages."""

    def copied(*doors: str) -> Path:
        folder = tmp_path_factory.mktemp("without")
        left_out = {str(SOURCE / door) for door in doors}

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


@pytest.mark.parametrize("door", COMMANDS)
def test_a_command_names_the_package_that_was_left_out(door, installation_without, tmp_path):
    installation = installation_without(door)
    write_experiment(tmp_path)
    found = run(installation, tmp_path, "-m", "pivident", *COMMANDS[door])
    assert found.returncode == 1
    assert found.stderr.startswith(f"error: this installation has no {door!r}"), found.stderr
    assert "Traceback" not in found.stderr


@pytest.mark.parametrize("door", DOORS)
def test_each_door_closed_alone_leaves_the_command_line(door, installation_without, tmp_path):
    installation = installation_without(door)
    code = "import pivident.cli.workflow, pivident.report.builder, pivident.notebook.displays"
    found = run(installation, tmp_path, "-c", code)
    assert found.returncode == 0, found.stderr
