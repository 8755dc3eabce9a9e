"""Files that a browser sends, written as they come: bounded, and in their place only when whole."""

from __future__ import annotations

import os
import secrets
import shutil
from collections.abc import AsyncIterator
from pathlib import Path

from pivident.app.studio.projects import (
    EXPERIMENT,
    RESULTS,
    Project,
    ProjectError,
    checked_name,
    is_robot,
)
from pivident.data.logs.tables.tables import endings, is_log
from pivident.robot.naming import ROBOT_FILES

#: Largest file that is taken [bytes].
MAX_BYTES = 16 * 2**30

#: Space that stays free on the disk [bytes].
RESERVE = 256 * 2**20

#: Deepest place of a file: a bag is a folder.
MAX_DEPTH = 2


def target(project: Project, name: str) -> Path:
    """Where a file is going to lie.

    Args:
        project: the project.
        name: its name, or folder and name.

    Raises:
        ProjectError: the name cannot be used.
    """
    parts = name.replace("\\", "/").split("/")
    if len(parts) > MAX_DEPTH or parts[0] == RESULTS:
        raise ProjectError(
            f"{name!r} lies in a folder of folders", advice="bring the file, or the bag"
        )
    for part in parts:
        checked_name(part)
    name = parts[-1]
    if not (is_robot(Path(name)) or is_log(name) or (len(parts) > 1 and name == "metadata.yaml")):
        raise ProjectError(
            f"{name} is neither a robot nor a log",
            advice=f"robots end with {', '.join(ROBOT_FILES)}, logs with {', '.join(endings())}",
        )
    return project.path_of("/".join(parts))


async def receive(path: Path, parts: AsyncIterator[bytes], declared: int | None) -> int:
    """Write what comes to a file; it appears when all of it is there.

    Args:
        path: the file; one that exists is replaced.
        parts: its content.
        declared: bytes that are announced, or None.

    Returns:
        Its size [bytes].

    Raises:
        ProjectError: it is too large, broke off, or cannot be written.
    """
    _check_room(path, declared or 0)
    created = not path.parent.exists()
    aside = path.with_name(f".{secrets.token_hex(8)}.part")
    size = 0
    try:
        path.parent.mkdir(exist_ok=True)
        with aside.open("xb") as file:
            async for part in parts:
                size += len(part)
                if size > MAX_BYTES:
                    raise _too_large(path)
                file.write(part)
        if declared is not None and size != declared:
            raise ProjectError(
                f"{path.name} broke off after {size} of {declared} bytes", advice="bring it again"
            )
        os.replace(aside, path)
    except OSError as error:
        raise ProjectError(
            f"{path.name} cannot be written: {error.strerror or error}",
            advice="free some space or choose another folder",
        ) from error
    finally:
        aside.unlink(missing_ok=True)
        if created and path.parent.exists() and not any(path.parent.iterdir()):
            path.parent.rmdir()
    return size


def remove(project: Project, relative: str) -> None:
    """Delete a file that was brought.

    Raises:
        ProjectError: there is no such file, or it is the experiment file.
    """
    path = project.path_of(relative)
    if relative == EXPERIMENT or path not in project.inputs():
        raise ProjectError(f"{relative} is no file that was brought to {project.name}")
    path.unlink()
    if path.parent != project.folder and not any(path.parent.iterdir()):
        path.parent.rmdir()


def _check_room(path: Path, size: int) -> None:
    """Refuse what is too large, or would fill the disk."""
    if size > MAX_BYTES:
        raise _too_large(path)
    free = shutil.disk_usage(next(p for p in path.parents if p.exists())).free
    if size > max(free - RESERVE, 0):
        raise ProjectError(
            f"{path.name} has {size / 1e6:.0f} MB, and {free / 1e6:.0f} MB are free on the disk",
            advice="free some space",
        )


def _too_large(path: Path) -> ProjectError:
    return ProjectError(
        f"{path.name} has more than {MAX_BYTES / 1e9:.0f} GB",
        advice="copy it into the project's folder instead",
    )
