"""A project as it is at one moment, from its files."""

from __future__ import annotations

from contextlib import suppress
from functools import cached_property
from typing import Any

from pivident.app.studio.gate import Gate, before_run
from pivident.app.studio.looks import named_files
from pivident.app.studio.projects import Content, Project, version_of
from pivident.app.studio.rows import Row, experiment_rows
from pivident.app.studio.run_folder import read_object
from pivident.app.studio.studio import Studio
from pivident.foundation.errors import ExperimentError


class View:
    """A project as it is at one moment; what several pieces of its page need is read once."""

    def __init__(self, studio: Studio, project: Project) -> None:
        self.studio, self.project = studio, project
        self.address = studio.address(project)
        self.draft_task = studio.settle(project)
        self.text = project.text
        self.version = version_of(self.text)
        self.content = Content(self.text)
        self.look = studio.looks.state(project.folder)
        self.folder = studio.looks.folder(project.folder)

    @cached_property
    def draft(self) -> dict[str, Any]:
        """The last draft."""
        return self.studio.drafted(self.project)

    @cached_property
    def signals(self) -> dict[str, Any]:
        """What signals there are; empty before they have been read."""
        return read_object(self.folder / "signals" / "signals.json") if self.has("signals") else {}

    @cached_property
    def check(self) -> dict[str, Any]:
        """What the check has found; empty before it has ended."""
        return read_object(self.folder / "findings" / "check.json") if self.has("findings") else {}

    @cached_property
    def rows(self) -> tuple[Row, ...]:
        """Lines of the experiment file; none where it is no TOML, which the check says."""
        try:
            return experiment_rows(self.text)
        except ExperimentError:
            return ()

    @cached_property
    def runs(self) -> list[dict[str, Any]]:
        """All runs, the last one first."""
        return self.studio.runs.listed(self.project.folder)

    @cached_property
    def files(self) -> list[tuple[str, int, int]]:
        """Path, size and time of the files that were brought."""
        found = []
        for path in (*self.project.inputs(), *self.project.test_logs()):
            with suppress(FileNotFoundError):  # removed at this moment
                about = path.stat()
                name = path.relative_to(self.project.folder).as_posix()
                found.append((name, about.st_size, about.st_mtime_ns))
        return found

    @cached_property
    def named(self) -> dict[str, float]:
        """Files of the project that the experiment file names, and when they came [s since 1970].

        A bag is there as a folder too.
        """
        found: dict[str, float] = {}
        for path in named_files(self.project.folder, self.content.content):
            if not path.is_relative_to(self.project.folder):
                continue
            with suppress(FileNotFoundError):  # removed at this moment
                name, time = path.relative_to(self.project.folder), path.stat().st_mtime
                for one in (name, *name.parents[:-1]):
                    found[one.as_posix()] = max(time, found.get(one.as_posix(), time))
        return found

    @cached_property
    def gate(self) -> Gate:
        """What holds an identification back."""
        if self.draft_task["state"] == "running" and not self.content.has_recording:
            return Gate("The experiment file is being drafted.")
        return before_run(self.content.has_recording, self.look, self.check)

    def has(self, stage: str) -> bool:
        """Whether a stage of the look has ended."""
        return self.look[stage] == "ready"

    @property
    def is_busy(self) -> bool:
        """Whether the page is going to change of itself."""
        looking = "running" in (self.look["signals"], self.look["findings"])
        running = any(run["state"] in ("running", "waiting") for run in self.runs)
        return looking or running or self.draft_task["state"] == "running"
