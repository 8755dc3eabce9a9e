"""The types that are shipped serve a user's program, checked strictly."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

HERE = Path(__file__).resolve().parent


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    """Lines of mypy about a program of a user and one that is wrong, by file; one run is enough."""
    pytest.importorskip("mypy", reason="mypy is not installed; pip install --group test")
    folder = tmp_path_factory.mktemp("mypy")
    text = (HERE / "downstream.py").read_text("utf-8")
    (folder / "right.py").write_text(text, encoding="utf-8")
    (folder / "wrong.py").write_text(
        text.replace("found.value(name)", "found.value(7)"), encoding="utf-8"
    )
    command = [sys.executable, "-m", "mypy", "--strict", "--ignore-missing-imports"]
    checked = subprocess.run(
        [*command, "--follow-imports=silent", "--allow-any-generics",
         "--cache-dir", str(folder / "cache"), "--config-file", os.devnull, "right.py", "wrong.py"],
        capture_output=True, text=True, cwd=folder,
        env=os.environ | {"MYPYPATH": str(HERE.parents[1] / "src")},
    )  # fmt: skip
    assert checked.returncode == 1, checked.stdout + checked.stderr
    return checked.stdout.splitlines()[:-1]


def test_a_program_of_a_user_is_typed(found):
    assert [line for line in found if not line.startswith("wrong.py:")] == []


def test_a_wrong_program_is_refused(found):
    (line,) = (line for line in found if line.startswith("wrong.py:"))
    assert "[arg-type]" in line
