"""What results show and write, by functions of higher layers that are registered here.

Results of every layer have a ``_repr_html_``, an `Identification` a table and files, a `Robot` a
way from other libraries. The functions behind them stand where all they need is known. They are
registered by name and imported at the first call, which keeps the lower layers free of imports
from there.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from typing import Any

_names: dict[str, str] = {}


def provided_by(**functions: str) -> None:
    """Register functions by their full names, each under the job that it does."""
    _names.update(functions)


def provided(job: str) -> Callable[..., Any]:
    """The function that is registered for a job."""
    module, _, name = _names[job].rpartition(".")
    return getattr(import_module(module), name)


def html_of(result: Any) -> str:
    """A result as HTML for a notebook."""
    return provided("html")(result)


def text_of(result: Any) -> str:
    """A result as the text that ``print`` shows."""
    return provided("text")(result)


def headline_of(result: Any) -> str:
    """A result on one line."""
    return provided("headline")(result)


def save(result: Any, folder: Any) -> None:
    """Write a result as files into a folder."""
    provided("files")(result, folder)
