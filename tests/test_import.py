"""``import pivident`` is light, and its front door leads everywhere it says."""

import subprocess
import sys

import pivident

HEAVY = ("numpy", "scipy", "numba", "pydantic", "polars", "h5py", "plotly", "cyclopts", "rich")


def run_python(code: str) -> str:
    return subprocess.run(
        [sys.executable, "-c", code], check=True, capture_output=True, text=True
    ).stdout


def test_import_loads_nothing_heavy():
    code = f"import sys, pivident; print([m for m in {HEAVY} if m in sys.modules])"
    assert run_python(code).strip() == "[]"


def test_command_line_help_loads_no_numerics():
    code = (
        "import sys; from pivident.cli import main; main(['--help']); "
        "print([m for m in ('numpy', 'scipy', 'numba', 'pydantic') if m in sys.modules])"
    )
    assert run_python(code).strip().endswith("[]")


def test_every_name_of_the_front_door_exists():
    for name in pivident.__all__:
        assert getattr(pivident, name) is not None, name
    assert set(pivident.__all__) - {"__version__"} == set(pivident._HOME)
    assert set(pivident.__all__) <= set(dir(pivident))


def test_unknown_name_is_an_attribute_error():
    assert not hasattr(pivident, "identfy")


def test_types_are_shipped():
    from importlib.resources import files

    assert (files("pivident") / "py.typed").is_file()
