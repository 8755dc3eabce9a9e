"""The files that an experiment file names: by name, by a pattern, or as a bag of several."""

from __future__ import annotations

import glob
from collections.abc import Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from pivident.experiment.recording_tables import DESIGN_FILE

#: Most files of a pattern or a bag that are looked at.
_MAX_FILES = 2000

#: Longer texts are no paths, in characters.
_MAX_LENGTH = 1000


def named_files(folder: Path, content: Mapping[str, Any]) -> list[Path]:
    """Files that any value of an experiment file names, with designs beside them, in order.

    Args:
        folder: of the experiment file.
        content: its tables.
    """
    named: set[Path] = set()
    for value in _texts(content):
        if len(value) > _MAX_LENGTH or "\0" in value:
            continue
        with suppress(OSError, ValueError):
            path = folder / value
            if any(c in value for c in "*?"):
                named |= {Path(p) for p in glob.glob(str(path))[:_MAX_FILES]}
            elif path.is_dir():
                named |= set(sorted(path.iterdir())[:_MAX_FILES])
            elif path.is_file():
                named |= {path, path.parent / DESIGN_FILE}
    return sorted(path for path in named if path.exists())


def _texts(value: Any) -> Iterator[str]:
    """Every text in a value."""
    if isinstance(value, str):
        yield value
    elif isinstance(value, (dict, list)):
        for inner in value.values() if isinstance(value, dict) else value:
            yield from _texts(inner)
