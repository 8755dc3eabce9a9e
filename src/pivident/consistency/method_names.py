"""Names of estimates that are made physically consistent: ``pc-piv`` is ``piv`` and the stage."""

from __future__ import annotations

from collections.abc import Iterable

from pivident.estimation.methods import METHODS

#: What stands before the name of the method whose estimate is made consistent.
PREFIX = "pc-"

#: Name of a consistent estimate, and the method of the free one that it is made from.
CONSISTENT_METHODS = {f"{PREFIX}{free}": free for free in METHODS}


def free_methods(names: Iterable[str]) -> list[str]:
    """The methods to run, each once: ``ls, piv, pc-piv`` needs ``ls`` and ``piv``."""
    return list(dict.fromkeys(CONSISTENT_METHODS.get(name, name) for name in names))


def made_consistent(names: Iterable[str]) -> tuple[str, ...]:
    """Methods whose estimate is asked for in its consistent form, without the prefix."""
    return tuple(CONSISTENT_METHODS[name] for name in names if name in CONSISTENT_METHODS)


def consistent_label(method: str) -> str:
    """Name of the consistent estimate in tables: ``PC-IDIM-PIV``."""
    return f"PC-{method}"
