"""Objects of pivident by their dotted names, and their source."""

from __future__ import annotations

import importlib
import inspect
from typing import Any

from pivident.errors import PividentError


class MissingObject(PividentError, LookupError):
    """A page names code that does not exist."""


def object_named(name: str) -> Any:
    """The object of a dotted name, such as ``pivident.signals.random_walk.smooth``.

    Raises:
        MissingObject: there is none.
    """
    parts = name.split(".")
    for count in range(len(parts), 0, -1):
        module = ".".join(parts[:count])
        try:
            found: Any = importlib.import_module(module)
        except ModuleNotFoundError as error:
            if error.name and not module.startswith(error.name):
                raise
            continue
        for part in parts[count:]:
            if not hasattr(found, part):
                raise MissingObject(f"{name}: {module} has no {part!r}")
            found = getattr(found, part)
        return found
    raise MissingObject(f"there is no {name}")


def source_of(name: str) -> str:
    """Source of an object, below a line with its module and where it stands there.

    Raises:
        MissingObject: there is no such object.
    """
    found = object_named(name)
    found = inspect.unwrap(getattr(found, "py_func", found))  # kernels are compiled
    lines, first = inspect.getsourcelines(found)
    return f"# {found.__module__}, line {first}\n{''.join(lines).rstrip()}"
