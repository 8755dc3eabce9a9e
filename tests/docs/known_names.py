"""What a name in the documentation may stand for: everything that pivident calls by a name.

Read from the objects themselves: fronts and their classes, the command line, the schemas of files,
and the strings of the sources, which columns, codes and values of options are.
"""

from __future__ import annotations

import ast
import builtins
import importlib
import inspect
import pkgutil
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any, get_args, get_type_hints

import pivident
from pivident.app.cli.app import app
from pivident.dynamics.parameters import standard_parameters
from pivident.estimation.methods import METHODS
from pivident.foundation import errors
from pivident.foundation.text import repair
from pivident.models.consistency.options import PREFIX
from pivident.robot.gallery import gallery_names, load_robot
from pivident.robot.mdh_keys import Entry, fields_of
from tests.docs.test_docstrings import PACKAGES, public_names, resolved

REPOSITORY = Path(__file__).resolve().parents[2]
SOURCE = Path(pivident.__file__).parent


@cache
def public_objects() -> dict[str, Any]:
    """Everything that the fronts name, errors included, by its last name."""
    found = {name.rpartition(".")[2]: resolved(name) for name in public_names()}
    found |= {name.rpartition(".")[2]: importlib.import_module(name) for name in PACKAGES}
    found |= {n: v for n, v in vars(errors).items() if inspect.isclass(v) or inspect.isfunction(v)}
    return found | {"pivident": pivident, "pv": pivident}


def attributes_of(kind: type) -> set[str]:
    """Public attributes of instances: methods, properties, fields, and what methods assign."""
    found = {name for name in dir(kind) if not name.startswith("_")}
    for base in kind.__mro__:
        found |= set(vars(base).get("__annotations__", ()))
        found |= set(getattr(base, "__dataclass_fields__", ()))
    return {name for name in found if not name.startswith("_")}


@cache
def classes() -> list[type]:
    """Public classes, and those of pivident that their methods and the public functions return."""
    found = [value for value in public_objects().values() if isinstance(value, type)]
    waiting = list(public_objects().values())
    while waiting:
        value = waiting.pop()
        functions = [value, *vars(value).values()] if isinstance(value, type) else [value]
        for function in functions:
            for kind in returned(function):
                if kind not in found:
                    found.append(kind)
                    waiting.append(kind)
    return found


def returned(value: Any) -> list[type]:
    """Classes of pivident that a function or property returns, or that fields of a class hold."""
    function = getattr(value, "__func__", None) or getattr(value, "fget", None) or value
    try:
        hints = get_type_hints(function)
    except (TypeError, NameError, AttributeError):
        return []
    kinds = []
    waiting = list(hints.values()) if isinstance(value, type) else [hints.get("return")]
    while waiting:
        one = waiting.pop()
        waiting += get_args(one)
        if isinstance(one, type) and one.__module__.startswith("pivident."):
            kinds.append(one)
    return kinds


@cache
def attributes() -> dict[str, list[Any]]:
    """Attributes of public classes by name, with the functions among them."""
    found: dict[str, list[Any]] = {}
    for kind in classes():
        for name in attributes_of(kind):
            found.setdefault(name, []).append(getattr(kind, name, None))
    return found


def arguments_of(function: Any) -> set[str]:
    """Names of the arguments of a function or class; ``**`` where it takes any."""
    try:
        signature = inspect.signature(function)
    except (TypeError, ValueError):
        return set()
    kinds = {p.kind for p in signature.parameters.values()}
    return set(signature.parameters) | ({"**"} if inspect.Parameter.VAR_KEYWORD in kinds else set())


@cache
def arguments() -> set[str]:
    """Names of all arguments of public functions, classes and their methods."""
    found: set[str] = set()
    for value in [*public_objects().values(), *(v for vs in attributes().values() for v in vs)]:
        if callable(value):
            found |= arguments_of(value)
    return found


@cache
def options() -> dict[tuple[str, ...], set[str]]:
    """The options of each command, by the words that call it."""
    found: dict[tuple[str, ...], set[str]] = {}

    def add(command: Any, words: tuple[str, ...]) -> None:
        given = command.assemble_argument_collection() if command.default_command else ()
        found[words] = {"--help", "-h", "--version", *(n for a in given for n in a.names)}
        for name in command:
            if not name.startswith("-"):
                add(command[name], (*words, name))

    add(app, ())
    return found


@cache
def tables() -> list[type[Entry]]:
    """The schemas of all files that people write."""
    for module in pkgutil.walk_packages([str(SOURCE)], "pivident."):
        path = SOURCE.joinpath(*module.name.split(".")[1:]).with_suffix(".py")
        if path.is_file() and "Entry" in path.read_text("utf-8"):
            importlib.import_module(module.name)
    found, waiting = [], [Entry]
    while waiting:
        kind = waiting.pop()
        found.append(kind)
        waiting += kind.__subclasses__()
    return found


@cache
def keys() -> set[str]:
    """The keys of all tables."""
    return {name for table in tables() for name in fields_of(table)}


@cache
def methods() -> set[str]:
    """Names of the methods, as the command line and experiment files have them."""
    return {*METHODS, *(PREFIX + name for name in METHODS), PREFIX}


@cache
def strings() -> set[str]:
    """Strings of the sources: columns, codes, names of files, values of options."""
    found: set[str] = set()
    for path in SOURCE.rglob("*.py"):
        tree = ast.parse(path.read_text("utf-8"))
        documents = {id(text) for text in docstrings(tree)}
        for node in ast.walk(tree):
            if isinstance(node, ast.Constant) and isinstance(node.value, str):
                if id(node) not in documents:
                    found.add(node.value)
            elif isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name):
                found.add(node.target.id)  # a field, which names a column or key of a file
    return found | {path.stem for path in SOURCE.rglob("*.*")}


def docstrings(tree: ast.AST) -> Iterator[ast.Constant]:
    for node in ast.walk(tree):
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
            yield node.value


@cache
def script_options() -> set[str]:
    """Options of the scripts of the repository."""
    scripts = (
        path for folder in ("benchmarks", "tools") for path in (REPOSITORY / folder).rglob("*.py")
    )
    return {o for path in scripts for o in re.findall(r'"(--[a-z-]+)"', path.read_text("utf-8"))}


@cache
def parameter() -> re.Pattern[str]:
    """What parameters of a model and gains of a joint are called: stem, joint, kind."""
    terms = "".join(
        p.read_text("utf-8") for p in (SOURCE / "robot" / "friction_terms").glob("*.py")
    )
    stems = {*re.findall(r'FrictionTerm\(\s*"(\w+)"', terms), "kp"}
    for name in gallery_names():
        stems |= {re.match(r"[a-z]+", p.name)[0] for p in standard_parameters(load_robot(name))}
    return re.compile(rf"(?:{'|'.join(sorted(stems))})\d*[mr]?(\[.+\])?")


@cache
def names() -> set[str]:
    """Words that are a name of pivident or of Python; strings of the sources are not among them."""
    return {
        *public_objects(),
        *(kind.__name__ for kind in classes()),
        *attributes(),
        *arguments(),
        *keys(),
        *methods(),
        *gallery_names(),
        *edits(),
        *labels(),
        *(word for words in options() for word in words),
        *BUILTINS,
    }


def edits() -> set[str]:
    """Kinds of edit in the files of findings: what is to be done to an experiment file."""
    return {
        kind.__name__ for base in (repair.OfKey, repair.OfLog) for kind in base.__subclasses__()
    }


def labels() -> set[str]:
    """Labels of the equations."""
    pages = "".join(path.read_text("utf-8") for path in (REPOSITORY / "docs").rglob("*.md"))
    return set(re.findall(r"^:label: (eq-[\w-]+)$", pages, re.MULTILINE))


def callables(name: str) -> list[Any]:
    """Public functions, classes and methods of a name."""
    found = [public_objects()[name]] if name in public_objects() else []
    return [value for value in found + attributes().get(name, []) if callable(value)]


def own(value: Any) -> bool:
    """Whether something is defined in pivident."""
    return str(getattr(value, "__module__", "")).startswith("pivident") or inspect.ismodule(value)


BUILTINS = set(dir(builtins))
