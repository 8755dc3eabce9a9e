"""Public functions say what their arguments are, in which shape and unit, and what they raise."""

import ast
import importlib
import inspect
import re
import textwrap
from functools import cache
from pathlib import Path

import pytest

import pivident
from pivident.foundation import errors
from tests.docs.page_blocks import DOCS

#: Packages with a front of their own.
PACKAGES = sorted(
    f"pivident.{stub.parent.name}" for stub in Path(pivident.__file__).parent.glob("*/__init__.pyi")
)

#: What an array argument or attribute says about itself: a unit or the lack of one, or a shape.
UNIT_OR_SHAPE = re.compile(
    r"\[[^\]]+\]|\(\w[\w +·−-]*(?:, ?\w*[\w +·−-]*)*\)|shape|squared units|unit of each|dimension"
    r"|index|indices|mask|of the input|likewise|sample|gain|unit",
    re.IGNORECASE,
)
ERRORS = {
    name: value
    for name, value in vars(errors).items()
    if isinstance(value, type) and issubclass(value, errors.PividentError)
}


def public_names() -> list[str]:
    """Dotted names of the front door and of the front doors of the packages."""
    found = [f"pivident.{name}" for name in pivident.__all__ if name != "__version__"]
    for package in PACKAGES:
        found += [f"{package}.{name}" for name in importlib.import_module(package).__all__]
    return found


@cache
def resolved(name: str):
    module, _, attribute = name.rpartition(".")
    return getattr(importlib.import_module(module), attribute)


def functions() -> list[str]:
    """Public functions, and public methods of the public classes as ``module.Class.method``."""
    return [name for name in public_names() if inspect.isfunction(resolved(name))]


def methods() -> list[tuple[str, str]]:
    pairs = []
    for name in public_names():
        found = resolved(name)
        if isinstance(found, type):
            for attribute, value in vars(found).items():
                function = (
                    value.__func__ if isinstance(value, (classmethod, staticmethod)) else value
                )
                if not attribute.startswith("_") and inspect.isfunction(function):
                    pairs.append((name, attribute))
    return pairs


def section(doc: str, *titles: str) -> str | None:
    """Body of a section of a Google docstring."""
    for title in titles:
        if match := re.search(rf"^{title}:\n((?:(?:[ \t]+.*)?\n?)*)", doc, re.MULTILINE):
            return match[1]
    return None


def entries(body: str) -> dict[str, str]:
    """Name and text of the entries of a section."""
    body = textwrap.dedent(body)
    found: dict[str, str] = {}
    for part in re.split(r"\n(?=\S)", body):
        head, colon, text = part.partition(":")
        if colon:
            for name in head.split(","):
                found[name.strip().lstrip("*")] = " ".join(text.split())
    return found


def missing_in(function, doc: str) -> list[str]:
    """What the docstring of a function does not say."""
    signature = inspect.signature(function)
    hints = {key: str(value.annotation) for key, value in signature.parameters.items()}
    names = [name for name in signature.parameters if name not in ("self", "cls")]
    told = entries(section(doc, "Args") or "")
    if "self" in signature.parameters and not told and all(said_in(n, doc) for n in names):
        return []  # a method whose summary says it all
    lacks = [f"argument {name!r}" for name in names if name not in told]
    lacks += [f"argument {name!r}, which does not exist" for name in told if name not in names]
    for name in names:
        if "ndarray" in hints[name] and name in told and not UNIT_OR_SHAPE.search(told[name]):
            lacks.append(f"shape or unit of {name!r}")
    returns = str(signature.return_annotation)
    if names and returns not in ("None", "<class 'inspect._empty'>"):
        if section(doc, "Returns", "Yields") is None and "self" not in signature.parameters:
            lacks.append("what it returns")
    return lacks


def said_in(name: str, doc: str) -> bool:
    """Whether the first line of a docstring names an argument."""
    return re.search(rf"\b{name}\b", doc.partition("\n")[0]) is not None


def raised_by(function) -> set[str]:
    """Errors of pivident that the function's own body raises."""
    tree = ast.parse(textwrap.dedent(inspect.getsource(function)))
    names = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Raise) and node.exc is not None:
            called = node.exc.func if isinstance(node.exc, ast.Call) else node.exc
            if isinstance(called, ast.Name) and called.id in ERRORS:
                names.add(called.id)
    return names


def undocumented_errors(function, doc: str) -> set[str]:
    told = section(doc, "Raises") or ""
    named = set(re.findall(r"\b[A-Z]\w+", told))
    bases = {name for name in named if name in ERRORS}
    return {
        name
        for name in raised_by(function)
        if not any(issubclass(ERRORS[name], ERRORS[base]) for base in bases)
    }


@pytest.mark.parametrize("name", functions())
def test_public_function_is_documented(name):
    function = resolved(name)
    doc = inspect.getdoc(function)
    assert doc, name
    assert not missing_in(function, doc), f"{name}: not documented"
    assert not undocumented_errors(function, doc), f"{name}: missing under Raises"


@pytest.mark.parametrize(("owner", "name"), methods())
def test_public_method_is_documented(owner, name):
    value = inspect.getattr_static(resolved(owner), name)
    function = value.__func__ if isinstance(value, (classmethod, staticmethod)) else value
    doc = inspect.getdoc(function)
    assert doc, f"{owner}.{name}"
    for base in resolved(owner).__mro__[1:]:  # what a class overrides is documented where it began
        if section(doc, "Args") is None and name in vars(base):
            doc += f"\n\n{inspect.getdoc(vars(base)[name]) or ''}"
    assert not missing_in(function, doc), f"{owner}.{name}: not documented"
    assert not undocumented_errors(function, doc), f"{owner}.{name}: missing under Raises"


@pytest.mark.parametrize("name", [n for n in public_names() if isinstance(resolved(n), type)])
def test_fields_of_public_classes_are_documented(name):
    found = resolved(name)
    doc = inspect.getdoc(found)
    assert doc, name
    fields = getattr(found, "__dataclass_fields__", {})
    told = {}
    for base in reversed(found.__mro__):  # inherited fields are documented where they are declared
        if "__dataclass_fields__" in vars(base) or base is found:
            own_doc = inspect.getdoc(base) or ""
            told |= entries(section(own_doc, "Attributes", "Args") or "")
    own = [field for field in fields if fields[field].init and not field.startswith("_")]
    assert not [field for field in own if field not in told], f"{name}: fields not documented"
    hints = {field: str(fields[field].type) for field in own}
    vague = [f for f in own if hints[f] == "np.ndarray" and not UNIT_OR_SHAPE.search(told[f])]
    assert not vague, f"{name}: neither shape nor unit of {vague}"


def test_what_is_missing_is_found():
    def vague(a, b: "np.ndarray") -> float:  # noqa: F821
        """A sum.

        Args:
            b: something.
            c: nothing.
        """
        raise errors.RecordingError("x") if a else ExperimentError("y")  # noqa: F821

    def raising() -> None:
        """Raise."""
        raise RecordingError("x")  # noqa: F821

    lacks = missing_in(vague, inspect.getdoc(vague))
    assert lacks == [
        "argument 'a'",
        "argument 'c', which does not exist",
        "shape or unit of 'b'",
        "what it returns",
    ]
    assert undocumented_errors(raising, "Raise.") == {"RecordingError"}
    assert undocumented_errors(raising, "Raise.\n\nRaises:\n    PividentError: always.") == set()


def documented_paths() -> list[str]:
    pages = "".join(p.read_text("utf-8") for p in (DOCS / "reference" / "api").glob("*.md"))
    shown = re.findall(r"^\.\. auto\w+:: (\S+)", pages, re.MULTILINE)
    return [name for name in shown if name != "pivident.foundation.errors"]


def test_every_public_name_is_in_the_reference():
    objects = [resolved(name) for name in documented_paths()]
    for name in public_names():
        found = resolved(name)
        if isinstance(found, type) and issubclass(found, errors.PividentError):
            continue
        if inspect.ismodule(found):  # a room, whose names stand on a page of their own
            continue
        assert any(found is other for other in objects), f"{name} is on no page of the reference"


def test_every_public_name_has_one_documented_path():
    shown = documented_paths()
    assert sorted(set(shown)) == sorted(shown)
    assert not set(shown) - set(public_names()), "not in the stub of a front"
    objects = [resolved(name) for name in shown]
    twice = [n for n, o in zip(shown, objects, strict=True) if sum(o is p for p in objects) > 1]
    assert not twice
