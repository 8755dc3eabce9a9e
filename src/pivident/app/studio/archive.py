"""A project as one archive (ZIP), which another machine opens.

Packed are the experiment file and the files that were brought, the logs and the results as asked.
An archive may be anybody's: names are checked one by one, links and absolute paths are refused, and
what it unpacks to is bounded before a byte is written.
"""

from __future__ import annotations

import shutil
import stat
import zipfile
from collections.abc import Iterator
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
from pivident.app.studio.uploads import MAX_BYTES, RESERVE, is_log, target
from pivident.foundation.files import atomic_folder

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
