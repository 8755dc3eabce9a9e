"""A project as it is at one moment, from its files.

Methods as somebody chooses them: in groups, each in a few words and with about its time.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from functools import cached_property
from typing import Any

from pivident.app.studio.gate import Gate, before_run
from pivident.app.studio.looks import named_files
from pivident.app.studio.projects import Content, Project, version_of
from pivident.app.studio.results_list import seconds_taken
from pivident.app.studio.rows import Row, experiment_rows
from pivident.app.studio.run_folder import read_object
from pivident.app.studio.studio import Studio
from pivident.estimation.methods import METHODS
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


#: Offered with the methods that people need.
CONSISTENT = {"pc-piv": "the physically consistent parameters nearest to those of piv"}

#: What is chosen where the experiment file says nothing.
DEFAULT = ("ls", "iv-full-rate", "piv")


def method_context(
    content: Content, check: dict[str, Any], runs: Sequence[dict[str, Any]]
) -> dict[str, Any]:
    """What the section of methods shows.

    Args:
        content: of the experiment file.
        check: content of ``check.json``; empty before there is one.
        runs: of the project, the last one first.
    """
    chosen = content.methods or list(DEFAULT)
    plan = check.get("plan") or {}
    groups: dict[str, dict[str, str]] = {"": {}}
    for name, method in METHODS.usable().items():
        groups.setdefault(method.group, {})[name] = method.summary
    groups[""] |= CONSISTENT
    offered = {name for methods in groups.values() for name in methods}
    groups[""] |= {name: "named in the experiment file" for name in chosen if name not in offered}
    listed = [
        {
            "title": title,
            "folded": bool(title) and not set(methods) & set(chosen),
            "methods": [
                {
                    "name": name,
                    "words": words,
                    "chosen": name in chosen,
                    "seconds": _seconds_of(plan, name) if plan else "",
                }
                for name, words in methods.items()
            ],
        }
        for title, methods in groups.items()
    ]
    return {
        "groups": listed if content.has_recording else [],
        "seconds": _common_time(plan) if plan else "",
        "factor": _slowness(plan, runs) if plan else 1.0,
    }


def _seconds_of(plan: dict[str, Any], name: str) -> float:
    """What a method adds to the expected time [s]; a consistent one, that of its free estimate."""
    return float(plan["seconds_of"].get(name.removeprefix("pc-"), 0.0))


def _common_time(plan: dict[str, Any]) -> float:
    """What an identification takes beside its methods [s]."""
    return float(plan["seconds"]) - sum(_seconds_of(plan, name) for name in plan["methods"])


def _slowness(plan: dict[str, Any], runs: Sequence[dict[str, Any]]) -> float:
    """How many times as long as expected the last identification took; 1 before there is one."""
    for run in runs:
        if run["step"] == "identify" and run["state"] == "done" and run["started"]:
            methods = sum(_seconds_of(plan, name) for name in run["methods"])
            return seconds_taken(run) / (_common_time(plan) + methods)
    return 1.0
