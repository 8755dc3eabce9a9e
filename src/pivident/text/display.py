"""Display of results in a notebook, by a module that is registered here.

Results of every layer have a ``_repr_html_``; the HTML itself is written at the top, where all of
them are known. One registration keeps the lower layers free of imports from there.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any

_provider = ""


def provided_by(module: str) -> None:
    """Register the module (full name) with ``html_of``; it is imported at the first display."""
    global _provider
    _provider = module


def html_of(result: Any) -> str:
    """A result as HTML for a notebook."""
    return import_module(_provider).html_of(result)
