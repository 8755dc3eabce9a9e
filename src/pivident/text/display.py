"""How a notebook shows a result: asked for here, answered by whoever is registered.

Results of every layer have a ``_repr_html_``; the HTML itself is made on top, where all of them
are known. One registration keeps the lower layers free of imports from there.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any

_provider = ""


def provided_by(module: str) -> None:
    """Register the module whose function ``html_of`` shows results.

    Args:
        module: its full name; it is imported at the first display.
    """
    global _provider
    _provider = module


def html_of(result: Any) -> str:
    """A result as HTML for a notebook.

    Args:
        result: anything that the registered module knows how to show.
    """
    return import_module(_provider).html_of(result)
