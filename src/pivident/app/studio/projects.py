"""Projects: folders with an experiment file, which is all that is remembered of them.

    FOLDER/
        arm one/experiment.toml      a project
        …
or FOLDER itself where it holds an experiment file. Texts that were replaced are kept in the
project's hidden folder, so that a change can be undone.
"""

from __future__ import annotations

import hashlib
import re
import threading
from collections import defaultdict
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from pivident.foundation.errors import PividentError
from pivident.foundation.files import atomic_folder
from pivident.foundation.text.toml import parse_toml
from pivident.robot.naming import ROBOT_FILES

#: The experiment file, results, and what is derived from both.
EXPERIMENT, RESULTS, HIDDEN = "experiment.toml", "results", ".pivident-studio"

#: Logs that results are tested on; nothing is drafted from them.
TEST_LOGS = "test_logs"

#: Earlier texts of an experiment file that are kept.
MAX_EARLIER = 50

#: Names of projects and of files in them: one component, no dot in front, printable.
_NAME = re.compile(r"[^\W_][\w .,()+-]{0,79}")


class ProjectError(PividentError, ValueError):
    """A project that is not there, cannot be made, or was changed meanwhile."""


class Changed(ProjectError):
    """The experiment file is no longer the one that a change was made to."""


@dataclass(frozen=True)
class Project:
    """A folder with an experiment file, or one that is going to have one.

    Attributes:
        folder: its folder.
        name: what it is called.
    """

    folder: Path
    name: str

    @property
    def experiment(self) -> Path:
        """The experiment file, which may not exist yet."""
        return self.folder / EXPERIMENT

    @property
    def hidden(self) -> Path:
        """Folder of what can be computed again."""
        return self.folder / HIDDEN

    @property
    def text(self) -> str:
        """Text of the experiment file; empty where there is none.

        Raises:
            ProjectError: it cannot be read.
        """
        try:
            return self.experiment.read_bytes().decode("utf-8")
        except FileNotFoundError:
            return ""
        except (OSError, UnicodeDecodeError) as error:
            raise ProjectError(
                f"{self.experiment} cannot be read ({error})",
                advice="save it as UTF-8 text that you may read",
            ) from error

    @property
    def changed(self) -> float:
        """When its experiment file was changed or a result came last [s since 1970]."""
        places = [self.experiment, self.folder / RESULTS]
        there = [p for p in places if p.exists()] or [self.folder]
        return max(place.stat().st_mtime for place in there)

    def text_of(self, version: str) -> str:
        """Text of the experiment file, as long as it is the one that somebody has seen.

        Args:
            version: `version_of` that text.

        Raises:
            Changed: the file has another text by now.
        """
        text = self.text
        if version_of(text) != version:
            raise Changed(
                f"{EXPERIMENT} was changed meanwhile, in another tab or by an editor",
                advice="it is shown as it is now, make the change again",
            )
        return text

    def inputs(self) -> list[Path]:
        """Files that were brought, by name; without the experiment file, results and hidden ones.

        A bag is a folder: its files are listed with it. Logs for tests are apart.
        """
        return sorted(p for p in self._files() if p != self.experiment)

    def test_logs(self) -> list[Path]:
        """Logs that results are tested on, by name."""
        folder = self.folder / TEST_LOGS
        return sorted(p for p in folder.glob("[!.]*") if p.is_file() and not p.is_symlink())

    def _files(self) -> list[Path]:
        found = []
        for path in self.folder.iterdir():
            if path.name.startswith(".") or path.name in (RESULTS, TEST_LOGS):
                continue
            if path.is_file():
                found.append(path)
            elif path.is_dir() and not path.is_symlink():
                found += [p for p in path.iterdir() if p.is_file() and p.name[0] != "."]
        return found

    def path_of(self, relative: str) -> Path:
        """Path of a file or folder in the project.

        Args:
            relative: its path from the project's folder, with forward slashes.

        Raises:
            ProjectError: it would lie elsewhere, or is hidden.
        """
        parts = relative.split("/")
        path = self.folder.joinpath(*parts)
        hidden = any(part == "" or part.startswith(".") or "\0" in part for part in parts)
        if hidden or not path.resolve().is_relative_to(self.folder.resolve()):
            raise ProjectError(f"{relative!r} is no file of the project {self.name}")
        return path


class Content:
    """What an experiment file says, as far as it can be read.

    Args:
        text: the file.
    """

    def __init__(self, text: str) -> None:
        self.text = text

    @cached_property
    def content(self) -> dict[str, Any]:
        """Its tables; empty where it is no TOML."""
        try:
            return parse_toml(self.text)
        except (ValueError, PividentError):
            return {}

    @property
    def robot(self) -> str:
        """Name of the robot, empty without one."""
        named = self.content.get("robot")
        named = named.get("model") if isinstance(named, dict) else named
        return named if isinstance(named, str) else ""

    @property
    def has_recording(self) -> bool:
        """Whether a log is described."""
        return bool(self.content.get("recording"))

    @property
    def methods(self) -> list[str]:
        """The methods that it names."""
        table = self.content.get("identify")
        named = table.get("methods") if isinstance(table, dict) else None
        return [m for m in named if isinstance(m, str)] if isinstance(named, list) else []


class Projects:
    """All projects below a folder; a change to an experiment file goes through here.

    Args:
        root: folder of the projects, or of a single one.
    """

    def __init__(self, root: Path) -> None:
        self.root = root.resolve()
        self._locks: dict[str, threading.Lock] = defaultdict(threading.Lock)

    @property
    def is_single(self) -> bool:
        """Whether the folder is a project itself."""
        return (self.root / EXPERIMENT).is_file()

    def listed(self) -> list[Project]:
        """All projects, the one that was changed last first."""
        if self.is_single:
            return [Project(self.root, self.root.name)]
        folders = [p for p in self.root.iterdir() if p.is_dir() and self._is_project(p)]
        found = [Project(p, p.name) for p in folders]
        return sorted(found, key=lambda project: project.changed, reverse=True)

    def _is_project(self, folder: Path) -> bool:
        made = (folder / EXPERIMENT).is_file() or (folder / HIDDEN).is_dir()
        return made and _NAME.fullmatch(folder.name) is not None

    def find(self, name: str) -> Project:
        """A project by its name.

        Raises:
            ProjectError: there is none of this name.
        """
        for project in self.listed():
            if project.name == name:
                return project
        raise ProjectError(f"there is no project {name!r} in {self.root}")

    def create(self, name: str) -> Project:
        """A new, empty project.

        Raises:
            ProjectError: the name cannot be one of a folder, or is taken.
        """
        project = self.free(name)
        try:
            project.hidden.mkdir(parents=True)
        except OSError as error:
            raise ProjectError(f"cannot create {project.folder}: {error.strerror}") from error
        return project

    def free(self, name: str) -> Project:
        """A project that may be made.

        Raises:
            ProjectError: the name cannot be one of a folder, or is taken.
        """
        name = checked_name(name.strip())
        if self.is_single:
            raise ProjectError(
                f"{self.root} is a project itself",
                advice="start pivident studio in the folder above it to have several",
            )
        if (self.root / name).exists():
            raise ProjectError(f"{name} exists already", advice="choose another name")
        return Project(self.root / name, name)

    def write(self, project: Project, text: str, version: str) -> None:
        """Replace the experiment file; the earlier text can be brought back.

        Args:
            project: whose.
            text: the new text.
            version: `version_of` the text that the change was made to.

        Raises:
            Changed: the file has another text by now.
            ProjectError: it cannot be written.
        """
        with self._locks[project.name]:
            now = project.text_of(version)
            if text == now:
                return
            earlier = self._earlier(project)
            with atomic_folder(project.folder) as build:
                if now:
                    number = int(earlier[-1].stem) + 1 if earlier else 1
                    kept = build / HIDDEN / "earlier" / f"{number:06d}.toml"
                    kept.parent.mkdir(parents=True)
                    kept.write_bytes(now.encode("utf-8"))
                (build / EXPERIMENT).write_bytes(text.encode("utf-8"))
            for old in earlier[: 1 - MAX_EARLIER]:
                old.unlink(missing_ok=True)

    def undo(self, project: Project) -> None:
        """Bring the text back that the experiment file had before its last change.

        Raises:
            ProjectError: there is no earlier text.
        """
        with self._locks[project.name]:
            earlier = self._earlier(project)
            if not earlier:
                raise ProjectError("there is no earlier text of the experiment file")
            with atomic_folder(project.folder) as build:
                (build / EXPERIMENT).write_bytes(earlier[-1].read_bytes())
            earlier[-1].unlink()

    def earlier_text(self, project: Project) -> str:
        """The text before the last change; empty without one."""
        earlier = self._earlier(project)
        return earlier[-1].read_bytes().decode("utf-8") if earlier else ""

    @staticmethod
    def _earlier(project: Project) -> list[Path]:
        """Earlier texts, the oldest first."""
        return sorted((project.hidden / "earlier").glob("[0-9]*.toml"))


def checked_name(name: str) -> str:
    """A name that is one of a file or folder everywhere.

    Raises:
        ProjectError: it is not.
    """
    if not _NAME.fullmatch(name) or name.endswith((".", " ")):
        raise ProjectError(
            f"{name!r} cannot be used as a name",
            advice="begin with a letter or digit and use letters, digits, spaces and . , ( ) + - "
            "_ only, at most 80",
        )
    return name


def version_of(text: str) -> str:
    """What tells one text of an experiment file from another."""
    return hashlib.sha256(text.encode("utf-8")).hexdigest()[:16]


def is_robot(path: Path) -> bool:
    """Whether a file describes a robot, by its ending; an experiment file does not."""
    return path.name.lower().endswith(ROBOT_FILES) and path.name != EXPERIMENT
