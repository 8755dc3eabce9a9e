"""Output folders that are either as they were or complete, never half written."""

from __future__ import annotations

import os
import secrets
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from os import PathLike
from pathlib import Path

from pivident.errors import PividentError


@contextmanager
def atomic_folder(path: str | PathLike[str]) -> Iterator[Path]:
    """Build the content of a folder aside, and move it in once all of it is there.

    The content is built in a hidden folder inside the nearest folder that exists, hence on the
    same file system, and moved file by file with ``os.replace``; other files stay where they
    are. An exception, Ctrl-C included, leaves the folder as it was.

    Args:
        path: folder to create or to write into.

    Yields:
        The hidden folder to write to.

    Raises:
        PividentError: the folder cannot be written, because it is read-only or the disk is full.
    """
    folder = Path(path)
    build: Path | None = None
    try:
        build = _nearest_folder(folder) / f".pivident-{secrets.token_hex(4)}"
        build.mkdir()
        yield build
        _move(build, folder)
    except OSError as error:
        if not _is_about(error, build, folder):
            raise
        raise PividentError(
            f"cannot write to {folder}: {error.strerror or error}; "
            "free some space, change its permissions or choose another folder"
        ) from error
    finally:
        if build is not None:
            shutil.rmtree(build, ignore_errors=True)


def _nearest_folder(path: Path) -> Path:
    """The path itself, or the closest of its parents that exists."""
    path = path.absolute()
    return next((p for p in (path, *path.parents) if p.exists()), path)


def _move(build: Path, folder: Path) -> None:
    """Move all files in. Ctrl-C in between waits until these few renames are done."""
    try:
        _move_remaining(build, folder)
    except KeyboardInterrupt:
        _move_remaining(build, folder)
        raise


def _move_remaining(build: Path, folder: Path) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    for source in sorted(p for p in build.rglob("*") if p.is_file()):
        target = folder / source.relative_to(build)
        target.parent.mkdir(parents=True, exist_ok=True)
        os.replace(source, target)


def _is_about(error: OSError, build: Path | None, folder: Path) -> bool:
    """Whether an error comes from writing here, and not from some other file that was read."""
    if error.filename is None or build is None:
        return True
    culprit = Path(os.fsdecode(error.filename)).absolute()
    return any(culprit.is_relative_to(p.absolute()) for p in (build, folder)) or (
        culprit in folder.absolute().parents
    )
