"""The rooms of pivident, the packages in each, and which module imports which."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from functools import cache
from pathlib import Path

from tests.conftest import REPOSITORY

SOURCE = REPOSITORY / "src"

#: Rooms from the lowest to the highest, and the packages of each in the same order; ``.`` stands
#: for the files of the room itself.
ROOMS = {
    "foundation": (
        "version", "text", "errors", "extras", "registry", "options", "files", "codec",
        "scratch", "golden_section",
        "progress", "threads", "distributions", "document", "compiled", "common_work",
    ),
    "robot": (".",),
    "dynamics": (".",),
    "signals": (".",),
    "data": ("logs", "recording"),
    "loop": ("simulation", "motion", "instruments"),
    "estimation": (".", "control_law", "drives"),
    "linear": (".",),
    "models": ("consistency", ".", "symbolic", "export"),
    "judgement": ("validation", "model_errors", "audit", "diagnostics", "report"),
    "experiment": (".", "check", "init"),
    "studies": (
        "friction_laws", "friction", "comparison", "prediction", "figures", "tables",
        "simulators", "payload", "flexibility", "collision", "excitation", "many", "paper",
    ),
    "app": ("studio", "notebook", "cli"),
}  # fmt: skip

#: Packages from the lowest to the highest, by the name that `package` gives them.
ORDER = (
    *(
        room if name == "." else f"{room}.{name}"
        for room, packages in ROOMS.items()
        for name in packages
    ),
    "__main__",
)


def modules() -> dict[str, Path]:
    """Every module of pivident and its file."""
    paths = sorted((SOURCE / "pivident").rglob("*.py"))
    names = [".".join(path.relative_to(SOURCE).with_suffix("").parts) for path in paths]
    return {n.removesuffix(".__init__"): path for n, path in zip(names, paths, strict=True)}


MODULES = modules()


def room(name: str) -> str:
    """The room of a module; "" for `pivident` itself."""
    return name.split(".")[1] if "." in name else ""


def package(name: str) -> str:
    """The package of a module, such as ``judgement.audit``, or its room."""
    two = ".".join(name.split(".")[1:3])
    return two if two in ORDER else room(name)


#: The one exception: ``studies.tables`` lists the tables of studies and fleets with all others.
TABLES_OF_STUDIES = ("pivident.studies.tables.chosen", "studies.many")


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


@cache
def graph() -> dict[str, set[str]]:
    """Modules that each module imports."""
    return {name: {to for to, _ in imported(name) if to != name} for name in MODULES}
