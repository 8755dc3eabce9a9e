"""``import pivident`` is light, and its front door leads everywhere it says."""

import ast
import importlib
import subprocess
import sys
from functools import cache
from pathlib import Path
from types import ModuleType

import pytest

import pivident
from tests.conftest import REPOSITORY
from tests.planar_log import write_experiment
from tests.rooms import MODULES

#: Packages with a front: names that are listed in a stub and imported at first use.
FRONTS = sorted(
    f"pivident.{stub.parent.name}" for stub in Path(pivident.__file__).parent.glob("*/__init__.pyi")
)

#: Packages that are a name of a front: reached by it, and listed where they are.
PACKAGES = {"figures"}

HEAVY = ("numpy", "scipy", "numba", "pydantic", "polars", "h5py", "plotly", "cyclopts", "rich")

#: What `identify` of a log without control law has no use for.
UNUSED = (
    "scipy.signal", "scipy.stats", "plotly", "narwhals",
    "pivident.loop.simulation.loop_kernel", "pivident.estimation.control_law.law_equations",
    "pivident.dynamics.closed_chains.closed_motion", "pivident.experiment.excite_keys",
    "pivident.studies.friction_laws.shapes",
)  # fmt: skip

#: Modules of pivident that are loaded by its end, packages included; it only falls.
MAX_MODULES_LOADED = 342

#: The experiment file of such a log.
WITHOUT_LOOP = """
robot = "planar_2r"

[recording]
files = "log.csv"
columns = {t = "time", q = ["q1", "q2"], tau = ["tau1", "tau2"]}
units = {q = "deg", tau = "N m"}

[identify]
methods = ["ls", "piv"]
"""


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


def test_identify_loads_what_it_uses(tmp_path):
    """A log without control law: no loop is simulated, no law sought, nothing drawn by plotly."""
    experiment = write_experiment(tmp_path, WITHOUT_LOOP)
    code = (
        f"import sys; from pivident.app.cli import main; main(['identify', {str(experiment)!r}, "
        f"'--out', {str(tmp_path / 'results')!r}]); "
        "print(*sys.modules)"
    )
    loaded = run_python(code).splitlines()[-1].split()
    assert sum(name.partition(".")[0] == "pivident" for name in loaded) <= MAX_MODULES_LOADED
    assert not {*UNUSED} & {*loaded}


def test_every_name_of_the_front_door_exists():
    for name in pivident.__all__:
        assert getattr(pivident, name) is not None, name
    assert set(pivident.__all__) <= set(dir(pivident))


def test_figures_are_reached_from_the_front_without_loading_what_draws():
    code = (
        "import sys, pivident; names = pivident.figures.__all__; "
        f"print(len(names) > 10, [m for m in {(*HEAVY, 'matplotlib')} if m in sys.modules])"
    )
    assert run_python(code).strip() == "True []"
    assert pivident.figures.figure_of_torques is pivident.studies.figure_of_torques


def test_the_front_door_is_small():
    assert len(pivident.__all__) <= 32  # figures, and the equations for estimators of one's own


@pytest.mark.parametrize("name", FRONTS)
def test_every_name_of_a_front_is_what_it_says(name):
    front = importlib.import_module(name)
    for attribute in front.__all__:
        is_module = isinstance(getattr(front, attribute), ModuleType)
        assert is_module == (attribute in PACKAGES), attribute


def test_a_name_has_one_home():
    homes: dict[str, list[str]] = {}
    for name in ("pivident", *FRONTS):
        for attribute in set(importlib.import_module(name).__all__) - PACKAGES:
            homes.setdefault(attribute, []).append(name)
    assert {key: value for key, value in homes.items() if len(value) > 1} == {}


def test_unknown_name_is_an_attribute_error():
    assert not hasattr(pivident, "identfy")


def test_types_are_shipped():
    from importlib.resources import files

    assert (files("pivident") / "py.typed").is_file()


@cache
def names_of(module: str) -> set[str]:
    """Names that a module binds at its top, and modules in it."""
    names = {name.rpartition(".")[2] for name in MODULES if name.rpartition(".")[0] == module}
    stub = MODULES[module].with_suffix(".pyi")
    paths = [MODULES[module], *([stub] if stub.exists() else [])]
    waiting = [node for path in paths for node in ast.parse(path.read_text("utf-8")).body]
    while waiting:
        node = waiting.pop()
        if isinstance(node, (ast.Import, ast.ImportFrom)):
            names |= {(alias.asname or alias.name).partition(".")[0] for alias in node.names}
        elif isinstance(node, (ast.FunctionDef, ast.ClassDef)):
            names.add(node.name)
        elif isinstance(node, (ast.If, ast.Try, ast.With)):
            waiting += node.body
        else:
            stored = (n for n in ast.walk(node) if isinstance(n, ast.Name))
            names |= {n.id for n in stored if isinstance(n.ctx, ast.Store)}
    return names


def test_benchmarks_and_examples_import_what_there_is():
    """They run for minutes or hours, and not all of them in the tests."""
    missing = [
        f"{path.relative_to(REPOSITORY)}:{node.lineno}: {node.module}.{alias.name}"
        for folder in ("benchmarks", "examples")
        for path in sorted((REPOSITORY / folder).rglob("*.py"))
        for node in ast.walk(ast.parse(path.read_text("utf-8")))
        if isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] == "pivident"
        for alias in node.names
        if node.module not in MODULES or alias.name not in names_of(node.module)
    ]
    assert not missing
