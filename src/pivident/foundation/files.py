"""Files that may be read, and output folders that are as they were or complete, never half written.

What a killed process leaves behind is put right by the next one that writes to the same place: a
build that was not finished is removed, and one that was being moved in is moved in.
"""

from __future__ import annotations

import errno
import os
import re
import secrets
import shutil
import stat
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from os import PathLike
from pathlib import Path
from typing import Any

from pivident.foundation.errors import PividentError

#: Largest file that people write [bytes]; larger ones are logs.
MAX_TEXT = 2**20

#: Names of folders that are being built, and of those that are complete and are being moved in.
BUILD, COMPLETE = ".pivident-", ".pivident-complete-"

_REMAINDER = re.compile(r"\.pivident-(complete-)?[0-9a-f]{8}")


def regular_file(path: str | PathLike[str]) -> Path:
    """The path, once it is known to name a file: a device or a pipe could be read without end.

    The ``strerror`` of its OSError says what else it is.
    """
    path = Path(path)
    if "\0" in str(path):
        raise OSError(errno.EINVAL, "its name holds a NUL character", str(path))
    mode = path.stat().st_mode
    if stat.S_ISDIR(mode):
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))
    if not stat.S_ISREG(mode):
        raise OSError(errno.EINVAL, "it is a device or a pipe, not a file", str(path))
    return path


def small_text(path: Path, refused: type[PividentError], kind: str) -> str:
    """Text of a file that people write, such as one of TOML.

    Args:
        path: the file.
        refused: kind of the error where it is none.
        kind: what it should be, such as ``an experiment file``.
    """
    try:
        size = regular_file(path).stat().st_size
        if size > MAX_TEXT:
            raise refused(f"has {size} bytes, too many for {kind}", advice="is it the log?")
        return path.read_text(encoding="utf-8")
    except OSError as error:
        raise refused(
            f"cannot be read ({error.strerror})", advice="check the path and its permissions"
        ) from error
    except UnicodeDecodeError as error:
        raise refused(
            f"is not UTF-8 text (byte {error.start})", advice="save it as UTF-8"
        ) from error


def named_file(folder: Path, name: str) -> Path:
    """The file that a text names from a folder; one that was written on Windows has backslashes."""
    path = folder / name
    return path if "\\" not in name or path.exists() else folder / name.replace("\\", "/")


def json_object(path: str | PathLike[str], max_bytes: int) -> dict[str, Any]:
    """A JSON object as plain values, of a file that may be anybody's.

    Its OSError says why the file cannot be read, its ValueError what else is wrong with it: too
    large, not JSON, or no object.
    """
    from pydantic_core import from_json

    file = regular_file(path)
    size = file.stat().st_size
    if size > max_bytes:
        raise ValueError(f"has {size} bytes, more than any file of its kind")
    try:
        content = from_json(file.read_bytes(), allow_inf_nan=False)
    except ValueError as error:
        raise ValueError(f"is not JSON: {error}") from None
    if not isinstance(content, dict):
        raise ValueError(f"holds a {type(content).__name__}, not an object")
    return content


def keep(path: Path, content: bytes) -> None:
    """Write what was made of an installed source, where Python itself may keep its bytecode.

    The folder may be missing, read-only or deleted at any time; the file is whole or not there.
    """
    if sys.dont_write_bytecode:
        return
    with suppress(OSError):
        path.parent.mkdir(exist_ok=True)
        with tempfile.TemporaryDirectory(dir=path.parent) as part:
            whole = Path(part) / path.name
            whole.write_bytes(content)
            whole.replace(path)


def check_output(folder: Path) -> None:
    """Refuse an output folder that could not be written after minutes of work."""
    folder = folder.absolute()
    try:
        existing = next(path for path in (folder, *folder.parents) if path.exists())
    except OSError as error:  # a name that no file system has
        raise PividentError(
            f"cannot write to {folder}: {error.strerror}", advice="choose another --out"
        ) from None
    if not existing.is_dir():
        raise PividentError(
            f"cannot write to {folder}: {existing} is a file", advice="choose another --out"
        )
    if not os.access(existing, os.W_OK | os.X_OK):
        raise PividentError(
            f"cannot write to {folder}: no permission in {existing}", advice="choose another --out"
        )


@contextmanager
def atomic_folder(path: str | PathLike[str]) -> Iterator[Path]:
    """Build the content of a folder aside, and move it in once all of it is there.

    The content is built in a hidden folder inside the nearest folder that exists, hence on the
    same file system. A new folder appears by one rename. Into one that exists, files are moved one
    by one with ``os.replace``; other files stay where they are. An exception, Ctrl-C included,
    leaves the folder as it was; a process that is killed while it moves files in leaves the rest
    in a hidden folder, from which the next call for the same folder finishes. Of two processes
    that write to one folder, one waits until the other has moved its files.
    """
    folder = Path(path)
    build: Path | None = None
    handle: int | None = None
    try:
        clear_up(folder)
        build, handle = _new_build(_nearest_folder(folder))
        yield build
        build = _move(build, folder)
    except OSError as error:
        if not _is_about(error, build, folder):
            raise
        raise PividentError(
            f"cannot write to {folder}: {error.strerror or error}",
            advice="free some space, change its permissions or choose another folder",
        ) from error
    finally:
        if build is not None:
            shutil.rmtree(build, ignore_errors=True)
        if handle is not None:
            os.close(handle)


def write_file(path: str | PathLike[str], text: str, errors: str = "strict") -> None:
    """Write one file, whole or not at all, as `atomic_folder` does; its folder may be missing.

    Args:
        path: of the file.
        text: its content.
        errors: what is done with characters that UTF-8 does not know.
    """
    target = Path(path)
    with atomic_folder(target.absolute().parent) as build:
        (build / target.name).write_text(text, encoding="utf-8", errors=errors)


def _nearest_folder(path: Path) -> Path:
    """The path itself, or the closest of its parents that exists."""
    path = path.absolute()
    return next((p for p in (path, *path.parents) if p.exists()), path)


def _new_build(parent: Path) -> tuple[Path, int | None]:
    """A hidden folder, and the handle of a lock that ends with this process."""
    while True:
        build = parent / f"{BUILD}{secrets.token_hex(4)}"
        build.mkdir()
        try:
            return build, _lock(build)
        except (BlockingIOError, FileNotFoundError):
            continue  # another process took it for a remainder before it was locked


def _lock(folder: Path, wait: bool = False) -> int | None:
    """Handle that locks a folder; None where folders cannot be locked."""
    try:
        import fcntl
    except ImportError:
        return None
    handle = os.open(folder, os.O_RDONLY)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
        if not os.path.samestat(os.fstat(handle), os.stat(folder)):
            raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT), str(folder))
        return handle
    except OSError as error:
        os.close(handle)
        if isinstance(error, (BlockingIOError, FileNotFoundError)):
            raise
        return None  # a file system without locks


def clear_up(folder: Path) -> None:
    """Remove or move in what killed processes left in the folder, or in the one above it.

    Args:
        folder: that such a process wrote to.
    """
    for place in dict.fromkeys((_nearest_folder(folder), folder.absolute().parent)):
        with suppress(OSError):
            for left in _remainders(place):
                if left.name.startswith(COMPLETE):
                    with _only_mover(place):
                        _settle(left)
                else:
                    _settle(left)


def _remainders(place: Path) -> list[Path]:
    return [p for p in place.iterdir() if _REMAINDER.fullmatch(p.name)]


def _settle(left: Path) -> None:
    """Finish or remove one hidden folder, unless its process is alive.

    One that was being moved in belongs to the mover of its folder, which the caller is now: its
    process is dead, though the lock may outlive it for a moment.
    """
    try:
        handle = _lock(left, wait=left.name.startswith(COMPLETE))
    except OSError:
        return
    if handle is None:
        return
    try:
        if left.name.startswith(COMPLETE):
            _move_remaining(left, left.parent)
        shutil.rmtree(left, ignore_errors=True)
    finally:
        os.close(handle)


@contextmanager
def _only_mover(folder: Path) -> Iterator[None]:
    """Wait until no other process moves files into the folder.

    A folder that is itself being built has one writer, this process, which has locked it already.
    """
    handle = None if folder.name.startswith(BUILD) else _lock(folder, wait=True)
    try:
        yield
    finally:
        if handle is not None:
            os.close(handle)


def _move(build: Path, folder: Path) -> Path:
    """Move all files in and return what is left; Ctrl-C waits until these few renames are done."""
    if not folder.exists():
        folder.parent.mkdir(parents=True, exist_ok=True)
        try:
            os.rename(build, folder)
            return build
        except OSError as error:
            if error.errno not in (errno.ENOTEMPTY, errno.EEXIST):
                raise  # else another process was faster
    complete = folder / build.name.replace(BUILD, COMPLETE)
    with _only_mover(folder):
        for left in _remainders(folder):  # of one that was killed since: older, hence first
            if left.name.startswith(COMPLETE):
                _settle(left)
        os.rename(build, complete)
        try:
            _move_remaining(complete, folder)
        except KeyboardInterrupt:
            _move_remaining(complete, folder)
            raise
        finally:
            shutil.rmtree(complete, ignore_errors=True)
    return complete


def _move_remaining(build: Path, folder: Path) -> None:
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
