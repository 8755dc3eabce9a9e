"""Physical consistency: physically possible standard parameters near an estimate."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pivident.consistency.consistent_model import ConsistentModel, make_consistent
    from pivident.consistency.constraints import Bounds
    from pivident.consistency.standard_from_base import standard_from_base

_HOME = {
    "Bounds": "pivident.consistency.constraints",
    "ConsistentModel": "pivident.consistency.consistent_model",
    "standard_from_base": "pivident.consistency.standard_from_base",
    "make_consistent": "pivident.consistency.consistent_model",
}

__all__ = ["Bounds", "ConsistentModel", "make_consistent", "standard_from_base"]


def __getattr__(name: str) -> Any:
    """A name of the package, imported from its home at first use."""
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(_HOME[name]), name)
