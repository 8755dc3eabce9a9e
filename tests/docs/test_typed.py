"""The types that are shipped serve a user's program, checked strictly; so are the examples."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.conftest import REPOSITORY

HERE = Path(__file__).resolve().parent

#: Programs of a user are checked strictly, whatever configuration the package itself has.
STRICT = """
[mypy]
strict = True
ignore_missing_imports = True
follow_imports = silent

[mypy-right,wrong]
disallow_any_generics = False
"""


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    """Lines of mypy about a program of a user, one that is wrong, and the scripts of the examples.

    They are checked together: nearly all of the time is that of the package and of NumPy.
    """
    pytest.importorskip("mypy", reason="mypy is not installed; pip install --group test")
    folder = tmp_path_factory.mktemp("mypy")
    text = (HERE / "downstream.py").read_text("utf-8")
    (folder / "right.py").write_text(text, encoding="utf-8")
    (folder / "wrong.py").write_text(
        text.replace("found.value(name)", "found.value(7)"), encoding="utf-8"
    )
    for script in (REPOSITORY / "examples" / "python").glob("*.py"):
        shutil.copy(script, folder)
    (folder / "strict.ini").write_text(STRICT, encoding="utf-8")
    checked = subprocess.run(
        [sys.executable, "-m", "mypy", "--config-file", "strict.ini",
         "--cache-dir", "cache", *sorted(path.name for path in folder.glob("*.py"))],
        capture_output=True, text=True, cwd=folder,
        env=os.environ | {"MYPYPATH": str(REPOSITORY / "src")},
    )  # fmt: skip
    assert checked.returncode == 1, checked.stdout + checked.stderr
    return checked.stdout.splitlines()[:-1]


def test_programs_of_users_and_of_the_examples_are_typed(found):
    assert [line for line in found if not line.startswith("wrong.py:")] == []


def test_a_wrong_program_is_refused(found):
    (line,) = (line for line in found if line.startswith("wrong.py:"))
    assert "[arg-type]" in line
