"""The types that are shipped serve a user's program, checked strictly."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

HERE = Path(__file__).resolve().parent


def mypy(path: Path, cache: Path) -> subprocess.CompletedProcess[str]:
    pytest.importorskip("mypy", reason="mypy is not installed; pip install --group test")
    command = [sys.executable, "-m", "mypy", "--strict", "--ignore-missing-imports"]
    source = HERE.parents[1] / "src"
    return subprocess.run(
        [*command, "--follow-imports=silent", "--allow-any-generics",
         "--cache-dir", str(cache), "--config-file", os.devnull, str(path)],
        capture_output=True, text=True, cwd=HERE, env=os.environ | {"MYPYPATH": str(source)},
    )  # fmt: skip


@pytest.fixture(scope="module")
def cache(tmp_path_factory):
    return tmp_path_factory.mktemp("mypy")


def test_a_program_of_a_user_is_typed(cache):
    checked = mypy(HERE / "downstream.py", cache)
    assert checked.returncode == 0, checked.stdout + checked.stderr


def test_a_wrong_program_is_refused(cache, tmp_path):
    wrong = (HERE / "downstream.py").read_text("utf-8")
    wrong = wrong.replace("found.value(name)", "found.value(7)")
    path = tmp_path / "wrong.py"
    path.write_text(wrong, encoding="utf-8")
    checked = mypy(path, cache)
    assert checked.returncode == 1 and "arg-type" in checked.stdout, checked.stdout
