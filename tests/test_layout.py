"""The order of the packages: each imports only from those before it, wherever the import stands."""

import ast
import re
from collections.abc import Iterator
from functools import cache
from itertools import count
from pathlib import Path

import pytest

from tests.conftest import REPOSITORY

SOURCE = REPOSITORY / "src"

#: From the lowest to the highest; CONTRIBUTING.md shows the same list.
ORDER = (
    "version", "text", "errors", "extras", "registry", "options", "files", "codec", "scratch",
    "threads", "document", "compiled", "common_work",
    "robot", "dynamics", "signals", "logs", "recording", "simulation", "motion", "instruments",
    "estimation", "control_law", "drives", "validation", "consistency",
    "friction_laws", "friction", "models",
    "model_errors", "experiment", "audit", "diagnostics", "check", "init",
    "report", "comparison", "prediction", "figures", "tables", "notebook",
    "linear", "symbolic", "export", "simulators", "payload", "flexibility", "collision",
    "excitation", "presentation", "many", "paper", "studio", "cli", "__main__",
)  # fmt: skip

#: Doors that can be closed: no package before the command line imports them.
DOORS = (
    "linear", "symbolic", "export", "simulators", "payload", "flexibility", "collision",
    "excitation", "many", "paper", "studio",
)  # fmt: skip

#: 6,000, loops whose law reads whole counts, iterations that go back and forth, noise of the
#: equations, methods that fit a simulation, logs without torque, options of regressions and
#: filters, algebraic signals and lines, loops on a measured base, derivatives kept in blocks.
MAX_LINES_OF_PACKAGE = 7800
#: Statements of all modules without docstrings, but for generated ones; it only falls, but for what
#: a judge needs that tries its own advice, a studio that carries it out, and shapes of model error.
MAX_STATEMENTS = 72_869
#: Modules that `identify` needs, those that a registry names included: a file for each method and
#: each friction term.
MAX_MODULES_OF_IDENTIFY = 192

#: Subpackages with a budget of their own.
ROOMS = (
    "dynamics.closed_chains",
    "estimation.covariance",
    "estimation.output_error",
    "estimation.literature.filters",
    "estimation.literature",
)


def modules() -> dict[str, Path]:
    found = {}
    for path in sorted((SOURCE / "pivident").rglob("*.py")):
        name = ".".join(path.relative_to(SOURCE).with_suffix("").parts)
        found[name.removesuffix(".__init__")] = path
    return found


MODULES = modules()


def package(name: str) -> str:
    return name.split(".")[1] if "." in name else ""


#: The one exception: ``pivident.studies.tables`` lists the tables of studies and fleets with all others.
TABLES_OF_STUDIES = ("pivident.studies.tables.chosen", "many")


def named(text: str) -> str:
    """The module that a string imports from, ``pivident.x.y:name`` or ``pivident.x.y.name``, or "".

    The name of a module alone says what a process runs.
    """
    module = text.partition(":")[0] if ":" in text else text.rpartition(".")[0]
    return module if module in MODULES and module != "pivident" and text not in MODULES else ""


def read_imports(name: str) -> Iterator[tuple[str, int]]:
    """Modules of pivident that a module imports anywhere, or names in a registry, and the line."""
    for node in ast.walk(ast.parse(MODULES[name].read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from ((a.name, node.lineno) for a in node.names if a.name in MODULES)
        elif isinstance(node, ast.ImportFrom):
            assert not node.level, f"{name}:{node.lineno}: relative import"
            for alias in node.names:
                whole = f"{node.module}.{alias.name}"
                if whole in MODULES or node.module in MODULES:
                    yield (whole if whole in MODULES else str(node.module)), node.lineno
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            module = named(node.value)
            if module and not (name, package(module)) == TABLES_OF_STUDIES:
                yield module, node.lineno  # an entry of a registry, imported when it is asked for


@cache
def imported(name: str) -> tuple[tuple[str, int], ...]:
    """The same, read once."""
    return tuple(read_imports(name))


def test_strings_that_are_imported_from_count_as_imports():
    module = "pivident.judgement.audit.recording_audit"
    assert named(f"{module}:x") == named(f"{module}.x") == module
    assert not named(module) and not named("pivident.identify")
    assert not named("pivident.judgement.audit.no_module.at_all")


@cache
def graph() -> dict[str, set[str]]:
    """Modules that each module imports."""
    return {name: {to for to, _ in imported(name) if to != name} for name in MODULES}


def test_every_package_has_its_place():
    assert {package(name) for name in MODULES} - {""} == set(ORDER)


@pytest.mark.parametrize("name", sorted(set(MODULES) - {"pivident"}))
def test_imports_go_downward(name):
    here = ORDER.index(package(name))
    upward = [
        f"{name}:{line} imports {to}"
        for to, line in imported(name)
        if package(to) != package(name) and (not package(to) or ORDER.index(package(to)) > here)
    ]
    assert not upward


def test_no_door_is_imported_by_what_stands_before_it():
    lowest = min(ORDER.index(door) for door in DOORS)
    below = [name for name in MODULES if package(name) in ORDER[:lowest]]
    assert not [(a, b) for a in below for b in graph()[a] if package(b) in DOORS]


def cycles() -> list[set[str]]:
    """Strongly connected components of more than one module (Tarjan 1972)."""
    number, low, stack, found = {}, {}, [], []
    counter = count()

    def visit(name: str) -> None:
        number[name] = low[name] = next(counter)
        stack.append(name)
        for other in graph()[name]:
            if other not in number:
                visit(other)
            if other in stack:
                low[name] = min(low[name], low[other])
        if low[name] == number[name]:
            component = set()
            while name not in component:
                component.add(stack.pop())
            if len(component) > 1:
                found.append(component)

    for name in graph():
        if name not in number:
            visit(name)
    return found


def test_no_modules_import_one_another():
    assert cycles() == []


def needed_by(name: str) -> set[str]:
    """Modules that a module needs, through imports inside functions too; packages not counted."""
    seen, waiting = set(), [name]
    while waiting:
        module = waiting.pop()
        if module not in seen:
            seen.add(module)
            waiting += graph()[module]
    return {module for module in seen if MODULES[module].name != "__init__.py"}


def test_identify_needs_few_modules():
    assert len(needed_by("pivident.estimation.identify")) <= MAX_MODULES_OF_IDENTIFY


def test_packages_stay_small():
    lines: dict[str, int] = {}
    for name, path in MODULES.items():
        here = len(path.read_text(encoding="utf-8").splitlines())
        room = next((r for r in ROOMS if f"{name}.".startswith(f"pivident.{r}.")), package(name))
        lines[room] = lines.get(room, 0) + here
    assert {name: n for name, n in lines.items() if n > MAX_LINES_OF_PACKAGE} == {}


def statements(path: Path) -> int:
    """Statements of a module without its docstrings, as its syntax tree counts them."""
    nodes = ast.walk(ast.parse(path.read_text(encoding="utf-8")))
    found = [node for node in nodes if isinstance(node, ast.stmt)]
    texts = [n for n in found if isinstance(n, ast.Expr) and isinstance(n.value, ast.Constant)]
    return len(found) - sum(isinstance(text.value.value, str) for text in texts)


def test_statements_only_become_fewer():
    assert sum(map(statements, MODULES.values())) <= MAX_STATEMENTS


def test_contributing_shows_the_same_order():
    text = (REPOSITORY / "CONTRIBUTING.md").read_text(encoding="utf-8")
    table = text[text.index("## Where things are") :]
    shown = [
        name
        for row in re.findall(r"^\|([^|]*`[^|]*)\|", table, re.MULTILINE)
        for name in re.findall(r"`(\w+)`", row)
    ]
    assert [name for name in shown if name in ORDER] == [n for n in ORDER if n != "__main__"]
