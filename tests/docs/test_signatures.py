"""Public functions name their keywords: none hides them behind ``**``."""

import importlib
import inspect
from pathlib import Path
from typing import Unpack, get_origin, get_type_hints

import pivident

STUBS = Path(pivident.__file__).parent.glob("*/__init__.pyi")
FRONTS = ["pivident", *sorted(f"pivident.{stub.parent.name}" for stub in STUBS)]
#: Functions whose keywords are open by nature, and why.
OPEN = {
    "Scenario.changed": "keywords are the tables of a scenario's file, each with its own schema",
}


def functions():
    """Public functions and methods of the fronts by name."""
    for front in map(importlib.import_module, FRONTS):
        for name in front.__all__:
            found = getattr(front, name)
            if inspect.isclass(found):
                own = (k for k in vars(found) if not k.startswith("_"))
                for method in own:
                    if callable(value := getattr(found, method)) and not inspect.isclass(value):
                        yield f"{name}.{method}", value
            elif inspect.isfunction(found):
                yield name, found


def test_keywords_are_spelled_out():
    """Those of a typed dictionary are, and its names stand in the docstring."""
    hidden, seen = [], 0
    for name, function in functions():
        seen += 1
        for parameter in inspect.signature(function).parameters.values():
            if parameter.kind is not inspect.Parameter.VAR_KEYWORD or name in OPEN:
                continue
            kind = get_type_hints(inspect.unwrap(function)).get(parameter.name)
            if get_origin(kind) is not Unpack:
                hidden.append(f"{name}(**{parameter.name})")
    assert seen > 300
    assert not hidden


def test_exceptions_are_needed_and_have_a_reason():
    known = dict(functions())
    for name, reason in OPEN.items():
        kinds = [p.kind for p in inspect.signature(known[name]).parameters.values()]
        assert inspect.Parameter.VAR_KEYWORD in kinds and reason
