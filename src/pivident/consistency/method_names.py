"""Names of physically consistent estimates: ``pc-piv`` is ``piv`` made consistent."""

from __future__ import annotations

from collections.abc import Iterable

from pivident.estimation.methods import METHODS

#: Prefix of the method whose estimate is made consistent.
PREFIX = "pc-"

#: Name of each consistent estimate, and the method of the free one.
CONSISTENT_METHODS = {f"{PREFIX}{free}": free for free in METHODS}


def free_methods(names: Iterable[str]) -> list[str]:
    """The methods to run, each once: ``ls, piv, pc-piv`` needs ``ls`` and ``piv``."""
    return list(dict.fromkeys(CONSISTENT_METHODS.get(name, name) for name in names))


def made_consistent(names: Iterable[str]) -> tuple[str, ...]:
    """Methods whose consistent estimate is requested, without the prefix."""
    return tuple(CONSISTENT_METHODS[name] for name in names if name in CONSISTENT_METHODS)


def consistent_label(method: str) -> str:
    """Name of the consistent estimate in tables: ``PC-IDIM-PIV``."""
    return f"PC-{method}"
