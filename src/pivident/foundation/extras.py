"""Libraries that come with an extra of the package: imported where they are used, by name."""

from __future__ import annotations

import sys
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from pivident.foundation.errors import PividentError


class MissingExtra(PividentError, ImportError):
    """A library that is not installed, and the extra that installs it.

    Attributes:
        library: name of the library, as it is imported.
        extra: name of the extra of pivident.
    """

    def __init__(self, library: str, extra: str, purpose: str) -> None:
        self.library, self.extra = library, extra
        super().__init__(
            f"{purpose} needs {library}, which is not installed",
            advice=f"run pip install 'pivident[{extra}]'",
        )


def require(module: str, *, extra: str, purpose: str) -> Any:
    """Import a module of an optional library.

    Args:
        module: its full name, such as ``pyarrow.parquet``.
        extra: the extra of pivident that installs the library.
        purpose: what needs it, the subject of the message.

    Returns:
        The module.

    Raises:
        MissingExtra: the library is not installed.
    """
    library = module.partition(".")[0]
    try:
        return import_module(module)
    except ImportError as error:
        if error.name is None or error.name.partition(".")[0] != library:
            raise  # the library is there, and something that it needs itself is not
        raise MissingExtra(library, extra, purpose) from error


def folder_of(library: str, *, extra: str, purpose: str) -> Path:
    """Folder of an optional library, of which a file is read and nothing imported.

    Arguments and errors are those of `require`.
    """
    spec = find_spec(library) if is_installed(library) else None
    if spec is None or not spec.submodule_search_locations:
        raise MissingExtra(library, extra, purpose)
    return Path(spec.submodule_search_locations[0])


def is_installed(library: str) -> bool:
    """Whether an optional library can be imported, without importing it.

    Args:
        library: its name, as it is imported.
    """
    if library in sys.modules:
        return sys.modules[library] is not None
    return find_spec(library) is not None
