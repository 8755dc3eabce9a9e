"""Files that a browser sends, written as they come: bounded, and in their place only when whole.

A project as one archive (ZIP), which another machine opens.

Packed are the experiment file and the files that were brought, the logs and the results as asked.
An archive may be anybody's: names are checked one by one, links and absolute paths are refused, and
what it unpacks to is bounded before a byte is written.
"""

from __future__ import annotations

import os
import secrets
import shutil
import stat
import zipfile
from collections.abc import AsyncIterator, Iterator
from pathlib import Path, PurePosixPath

from pivident.app.studio.projects import (
    EXPERIMENT,
    RESULTS,
    Project,
    ProjectError,
    Projects,
    checked_name,
    is_robot,
)
from pivident.data.logs.tables.tables import endings, is_log
from pivident.foundation.files import atomic_folder
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


#: Most files of an archive.
MAX_FILES = 10_000

#: Kinds of files in results: pages, tables, models, pictures. Nothing that a desktop would run.
RESULT_FILES = (
    ".json", ".csv", ".html", ".txt", ".toml", ".urdf", ".xml", ".sdf", ".c", ".h", ".py", ".tex",
    ".png", ".svg", ".pdf", ".parquet", ".npz", ".rrd",
)  # fmt: skip


def pack(project: Project, path: Path, *, logs: bool = True, results: bool = True) -> Path:
    """Write a project as an archive.

    Args:
        project: the project.
        path: the archive to write.
        logs: whether the logs go with it; without them it can be read, and not be run again.
        results: whether the results go with it.

    Returns:
        The archive.
    """
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED, compresslevel=6) as archive:
        for file in _packed(project, logs, results):
            archive.write(file, file.relative_to(project.folder).as_posix())
    return path


def _packed(project: Project, logs: bool, results: bool) -> Iterator[Path]:
    """The files that go into an archive."""
    if project.experiment.is_file():
        yield project.experiment
    for path in (*project.inputs(), *project.test_logs()):
        if is_robot(path) or (logs and not path.is_symlink()):
            yield path
    if results and (folder := project.folder / RESULTS).is_dir():
        yield from sorted(p for p in folder.rglob("*") if p.is_file() and not p.is_symlink())


def open_archive(projects: Projects, path: Path, name: str) -> Project:
    """A new project with the content of an archive, all of it or nothing.

    Args:
        projects: where it is made.
        path: the archive.
        name: name of the new project.

    Raises:
        ProjectError: it is no archive of a project, holds what no project has, or is too large.
    """
    try:
        with zipfile.ZipFile(path) as archive:
            entries = [e for e in archive.infolist() if not e.is_dir()]
            project = projects.free(name)
            places = {entry.filename: _place(project, entry) for entry in entries}
            _check_size(entries, path)
            if EXPERIMENT not in places:
                raise ProjectError(f"{path.name} holds no {EXPERIMENT}", advice="it is no project")
            with atomic_folder(project.folder) as build:
                for entry in entries:
                    _unpack(archive, entry, build / places[entry.filename])
    except (zipfile.BadZipFile, NotImplementedError, RuntimeError, EOFError) as error:
        raise ProjectError(f"{path.name} is no archive that can be read: {error}") from error
    return project


def _place(project: Project, entry: zipfile.ZipInfo) -> PurePosixPath:
    """Where an entry belongs, relative to the project's folder."""
    name = entry.filename
    kind = stat.S_IFMT(entry.external_attr >> 16)
    parts = name.split("/")
    if kind not in (0, stat.S_IFREG) or entry.flag_bits & 0x1:
        raise ProjectError(f"{name!r} in the archive is a link, a device or encrypted")
    for part in parts:
        checked_name(part)
    if name != EXPERIMENT:
        if parts[0] == RESULTS and len(parts) > 1:
            if not name.lower().endswith(RESULT_FILES) and not is_log(name):
                raise ProjectError(f"{name!r} in the archive is nothing that results have")
        else:
            target(project, name)
    return PurePosixPath(name)


def _check_size(entries: list[zipfile.ZipInfo], path: Path) -> None:
    """Refuse an archive that unpacks to too much."""
    size = sum(entry.file_size for entry in entries)
    free = shutil.disk_usage(path.parent).free - RESERVE
    if len(entries) > MAX_FILES or size > MAX_BYTES or size > free:
        raise ProjectError(
            f"{path.name} unpacks to {len(entries)} files and {size / 1e6:.0f} MB, which is more "
            f"than {MAX_FILES} files, {MAX_BYTES / 1e6:.0f} MB, or what is free on the disk"
        )


def _unpack(archive: zipfile.ZipFile, entry: zipfile.ZipInfo, path: Path) -> None:
    """Write one entry, no more than it says it has."""
    path.parent.mkdir(parents=True, exist_ok=True)
    left = entry.file_size
    with archive.open(entry) as source, path.open("xb") as file:
        while part := source.read(min(left + 1, 2**20)):
            left -= len(part)
            if left < 0:
                raise ProjectError(f"{entry.filename!r} in the archive is larger than it says")
            file.write(part)
