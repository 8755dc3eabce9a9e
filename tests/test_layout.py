"""The order of the rooms: each imports only from those before it, wherever the import stands."""

import ast
import re
from itertools import count
from pathlib import Path

import pytest

from tests import rooms_picture
from tests.conftest import REPOSITORY
from tests.rooms import MODULES, ORDER, ROOMS, graph, imported, named, package, room

#: Doors that can be closed: nothing but the faces of pivident imports them.
DOORS = (
    "linear", "models.symbolic", "models.export", "studies.simulators", "studies.payload",
    "studies.flexibility", "studies.collision", "studies.excitation", "studies.many",
    "studies.paper", "app.studio",
)  # fmt: skip

#: Rooms at the top of `pivident`; their number only falls.
MAX_ROOMS = 13

#: 6,000, loops whose law reads whole counts, iterations that go back and forth, noise of the
#: equations, methods that fit a simulation, logs without torque, options of regressions and
#: filters, algebraic signals and lines, loops on a measured base, derivatives kept in blocks;
#: torques of a loop and friction of a program's own (180 lines), examples in docstrings (60), and
#: imports where they are used (3).
MAX_LINES_OF_PACKAGE = 8363
#: Statements of all modules without docstrings, but for generated ones; it only falls, but for what
#: takes the horizon of a simulation (136), sizes of causes by instruments (77), friction that
#: changes with a temperature (139) and joints that no record moves (45).
MAX_STATEMENTS = 75_644
#: Modules, packages included; it only falls.
MAX_MODULES = 750
#: Modules that `identify` needs, those that a registry names included: a file for each method and
#: each friction term, joints that are found by name, estimates with their table, and progress.
MAX_MODULES_OF_IDENTIFY = 193

#: Parts of packages with a budget of their own.
PARTS = (
    "dynamics.closed_chains",
    "estimation.covariance",
    "estimation.output_error",
    "estimation.literature.filters",
    "estimation.literature",
)


def test_strings_that_are_imported_from_count_as_imports():
    module = "pivident.judgement.audit.recording_audit"
    assert named(f"{module}:x") == named(f"{module}.x") == module
    assert not named(module) and not named("pivident.identify")
    assert not named("pivident.judgement.audit.no_module.at_all")


def test_every_package_has_its_place():
    files = {name for name, path in MODULES.items() if path.name != "__init__.py"}
    fronts = {name.removeprefix("pivident.") for name in set(MODULES) - files}
    assert {package(name) for name in files} | (fronts & set(ORDER)) == set(ORDER)
    assert {room(name) for name in MODULES} - {"", "__main__"} == set(ROOMS)
    assert len(ROOMS) <= MAX_ROOMS


@pytest.mark.parametrize("name", sorted(n for n in MODULES if package(n) in ORDER))
def test_imports_go_downward(name):
    here = ORDER.index(package(name))
    above = {*ORDER[: here + 1]}  # a front is above nothing: what it names is imported from there
    assert not [
        f"{name}:{line} imports {to}" for to, line in imported(name) if package(to) not in above
    ]


def test_no_door_is_imported_by_what_stands_before_it():
    others = [name for name in MODULES if package(name) not in DOORS and room(name) != "app"]
    assert not [(a, b) for a in others for b in graph()[a] if package(b) in DOORS]


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
        part = next((p for p in PARTS if f"{name}.".startswith(f"pivident.{p}.")), package(name))
        lines[part] = lines.get(part, 0) + here
    assert {name: n for name, n in lines.items() if n > MAX_LINES_OF_PACKAGE} == {}


def statements(path: Path) -> int:
    """Statements of a module without its docstrings, as its syntax tree counts them."""
    nodes = ast.walk(ast.parse(path.read_text(encoding="utf-8")))
    found = [node for node in nodes if isinstance(node, ast.stmt)]
    texts = [n for n in found if isinstance(n, ast.Expr) and isinstance(n.value, ast.Constant)]
    return len(found) - sum(isinstance(text.value.value, str) for text in texts)


def test_statements_and_modules_only_become_fewer():
    assert sum(map(statements, MODULES.values())) <= MAX_STATEMENTS
    assert len(MODULES) <= MAX_MODULES


def test_no_module_is_named_after_a_representation():
    """How a result is shown is said by its ``account``, with what `foundation.document` has."""
    names = [n for n in MODULES if room(n) != "foundation"]
    assert not [n for n in names if re.search(r"_(page|text|html|schema|findings)$", n)]
    files = {n.rpartition(".")[2] for n in names if n.endswith("_files")}
    assert files == {"log_files", "source_files", "robot_files"}  # files that are the subject


def test_contributing_shows_the_same_order():
    text = (REPOSITORY / "CONTRIBUTING.md").read_text(encoding="utf-8")
    table = text[text.index("## Where things are") :]
    shown = [
        ".".join(filter(None, names))
        for names in re.findall(r"^\| `(\w+)`(?:\.`(\w+)`)? \|", table, re.MULTILINE)
    ]
    assert [name for name in shown if name in ORDER] == [n for n in ORDER if n != "__main__"]


def test_contributing_opens_with_the_picture_of_the_rooms():
    assert not rooms_picture.missing_steps()
    assert rooms_picture.page(text := rooms_picture.PAGE.read_text("utf-8")) == text
