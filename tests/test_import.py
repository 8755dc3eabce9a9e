"""``import pivident`` is light, and its front door leads everywhere it says."""

import importlib
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import pytest

import pivident

#: Packages with a front: names that are listed in a stub and imported at first use.
FRONTS = sorted(
    f"pivident.{stub.parent.name}" for stub in Path(pivident.__file__).parent.glob("*/__init__.pyi")
)

HEAVY = ("numpy", "scipy", "numba", "pydantic", "polars", "h5py", "plotly", "cyclopts", "rich")


def run_python(code: str) -> str:
    return subprocess.run(
        [sys.executable, "-c", code], check=True, capture_output=True, text=True
    ).stdout


def test_import_loads_nothing_heavy():
    code = f"import sys, pivident; print([m for m in {HEAVY} if m in sys.modules])"
    assert run_python(code).strip() == "[]"


def test_command_line_help_loads_neither_numerics_nor_markdown():
    code = (
        "import sys; from pivident.app.cli import main; main(['--help']); "
        "heavy = ('numpy', 'scipy', 'numba', 'pydantic', 'markdown_it'); "
        "print([m for m in heavy if m in sys.modules])"
    )
    assert run_python(code).strip().endswith("[]")


def test_every_name_of_the_front_door_exists():
    for name in pivident.__all__:
        assert getattr(pivident, name) is not None, name
    assert set(pivident.__all__) <= set(dir(pivident))


def test_the_front_door_is_small():
    assert len(pivident.__all__) <= 29


@pytest.mark.parametrize("name", FRONTS)
def test_every_name_of_a_front_is_what_it_says(name):
    front = importlib.import_module(name)
    for attribute in front.__all__:
        assert not isinstance(getattr(front, attribute), ModuleType), attribute


def test_a_name_has_one_home():
    homes: dict[str, list[str]] = {}
    for name in ("pivident", *FRONTS):
        for attribute in importlib.import_module(name).__all__:
            homes.setdefault(attribute, []).append(name)
    assert {key: value for key, value in homes.items() if len(value) > 1} == {}


def test_unknown_name_is_an_attribute_error():
    assert not hasattr(pivident, "identfy")


def test_types_are_shipped():
    from importlib.resources import files

    assert (files("pivident") / "py.typed").is_file()
