"""What may be done to a project, and what follows of itself: drafts, looks and runs.

robot ─▶ experiment.toml with the robot alone ─▶ the arm is drawn
+ log ─▶ draft (as `pivident init`)           ─▶ signals, assumptions, check
change of a line ─▶ look again                ─▶ run (as `pivident identify`)
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any
from urllib.parse import quote

from pivident.app.studio.drafting import DRAFT, ROBOT, draft, draft_example
from pivident.app.studio.fixes import Fix, repaired_text, with_laws
from pivident.app.studio.gate import Gate, before_run, before_use
from pivident.app.studio.looks import Looks
from pivident.app.studio.projects import (
    Changed,
    Content,
    Project,
    ProjectError,
    Projects,
    is_robot,
    version_of,
)
from pivident.app.studio.run_folder import RunFolder, read_object
from pivident.app.studio.runs import Runs
from pivident.app.studio.steps import STEPS
from pivident.app.studio.tasks import Tasks
from pivident.data.logs.tables.tables import is_log
from pivident.experiment.edited_file import confirmed, edited
from pivident.foundation.codec import decode
from pivident.foundation.errors import ExperimentError, UnusableValue, require_known
from pivident.foundation.text.toml import string_text
from pivident.robot.gallery import gallery_names


class Studio:
    """All projects of a folder, with what is being computed for them.

    Args:
        root: folder of the projects, or of a single one.
        at_once: runs that are computed at the same time.
    """

    def __init__(self, root: Path, at_once: int = 1) -> None:
        self.projects = Projects(root)
        self.tasks = Tasks(preloaded=("pivident.app.cli",))
        self.looks = Looks(self.tasks)
        self.runs = Runs(at_once)
        self._drafted_from: dict[Path, str] = {}  # version that a draft in progress replaces

    def resume(self) -> None:
        """Go on with runs that wait, or were left by a server that has ended."""
        self.runs.resume([project.folder for project in self.projects.listed()])

    def close(self) -> None:
        """Stop what is derived; runs go on."""
        self.tasks.close()
        self.runs.close()

    @staticmethod
    def address(project: Project) -> str:
        """Address of a project's page."""
        return f"/p/{quote(project.name, safe='')}"

    def example(self, name: str) -> Project:
        """A new project with a log that is simulated beside the server.

        Raises:
            ProjectError: the name cannot be used.
        """
        project = self.projects.create(name)
        self.choose_robot(project, ROBOT, version_of(""))
        self.simulate_log(project)
        return project

    def simulate_log(self, project: Project) -> None:
        """Simulate a log of the example's arm beside the server, and draft the experiment file.

        Raises:
            ProjectError: the project has another robot, or a log.
        """
        text = project.text
        if Content(text).robot != ROBOT or self.logs(project):
            raise ProjectError(f"a log is simulated for {ROBOT} alone, and where there is none yet")
        self._drafted_from[project.folder] = version_of(text)
        self.tasks.start(self._task(project), draft_example, project.folder)

    def choose_robot(self, project: Project, model: str, version: str) -> None:
        """Take a robot; without an experiment file one is begun with it.

        Args:
            project: whose.
            model: name in the gallery, or of a file of the project.
            version: of the experiment file that the page shows.

        Raises:
            ProjectError: there is no such robot.
        """
        known = [*gallery_names(), *(p.name for p in project.inputs() if is_robot(p))]
        require_known(model, known, f"there is no robot {model!r}", ProjectError)
        text = project.text
        view = Content(text)
        if not view.robot:
            self.projects.write(project, f"[robot]\nmodel = {string_text(model)}\n{text}", version)
        elif view.robot != model:
            table = isinstance(view.content.get("robot"), dict)
            place = ("robot", "model") if table else ("robot",)
            self.projects.write(project, edited(text, [(place, string_text(model))]), version)

    def brought(self, project: Project, path: Path) -> None:
        """A file has come: the first robot is taken; a log redrafts a file that nobody has changed.

        Args:
            project: whose.
            path: the file.
        """
        text = project.text
        name = path.relative_to(project.folder).as_posix()
        if path in project.test_logs():
            return
        if is_robot(path) and not Content(text).robot:
            self.choose_robot(project, name, version_of(text))
        elif is_log(path.name) and text and text == self.drafted(project).get("text"):
            self.draft(project)

    def draft(
        self, project: Project, answers: Mapping[str, str] | None = None, column_names: str = ""
    ) -> None:
        """Draft the experiment file from the files of the project, beside the server.

        Args:
            project: whose.
            answers: to the questions of the draft before.
            column_names: of logs without header, separated by commas.

        Raises:
            ProjectError: there is no robot or no log.
        """
        text = project.text
        robot, logs = Content(text).robot, self.logs(project)
        if not robot or not logs:
            missing = "a robot" if not robot else "a log"
            raise ProjectError(
                f"{project.name} has no {missing[2:]} yet", advice=f"bring {missing} first"
            )
        names = [name.strip() for name in column_names.split(",") if name.strip()]
        self._drafted_from[project.folder] = version_of(text)
        self.tasks.start(
            self._task(project), draft, project.folder, logs, robot, dict(answers or {}), (), names
        )

    def logs(self, project: Project) -> list[str]:
        """Logs of a project, bags in folders as one, relative to it."""
        found: dict[str, None] = {}
        for path in project.inputs():
            if is_log(path.name) and not is_robot(path):
                place = path if path.parent == project.folder else path.parent
                found[place.relative_to(project.folder).as_posix()] = None
        return list(found)

    def settle(self, project: Project) -> dict[str, str]:
        """Write a draft that is done, begin one where robot and log are there; its task's state."""
        state = self.tasks.state(self._task(project))
        if state["state"] == "none":
            content = Content(project.text)
            new = not (project.hidden / DRAFT).exists()
            if new and content.robot and not content.has_recording and self.logs(project):
                self.draft(project)
                state = self.tasks.state(self._task(project))
        elif state["state"] == "done":
            self.tasks.stop(self._task(project))
            text, version = self.drafted(project).get("text"), self._drafted_from[project.folder]
            if text:
                try:
                    self.projects.write(project, text, version)
                except Changed:
                    pass  # somebody has written it meanwhile, and may ask for another draft
        self.looks.want(project.folder)
        return state

    def drafted(self, project: Project) -> dict[str, Any]:
        """The last draft with its questions; empty without one."""
        return read_object(project.hidden / DRAFT)

    def edit(
        self, project: Project, place: Sequence[str | int], value: str | None, version: str
    ) -> None:
        """Change or remove one key.

        Args:
            project: whose.
            place: tables and key.
            value: TOML; None removes it.
            version: of the text that the page shows.

        Raises:
            ExperimentError: the value cannot be one of this key.
            Changed: the file is no longer the one that the page shows.
        """
        self.projects.write(project, edited(project.text_of(version), [(place, value)]), version)

    def confirm(self, project: Project, place: Sequence[str | int], version: str) -> None:
        """Note that an assumption is right.

        Args:
            project: whose.
            place: tables and key.
            version: of the text that the page shows.

        Raises:
            ExperimentError: this is no assumption.
            Changed: the file is no longer the one that the page shows.
        """
        self.projects.write(project, confirmed(project.text_of(version), tuple(place)), version)

    def fix(self, project: Project, remark: int, fix: int, version: str) -> None:
        """Apply a fix of a finding.

        Args:
            project: whose.
            remark: number of the finding.
            fix: number of the fix.
            version: of the text that the page shows.
        """
        text = project.text_of(version)
        found = read_object(self.looks.folder(project.folder) / "findings" / "check.json")
        try:
            chosen = decode(Fix, found["remarks"][remark]["fixes"][fix])
        except UnusableValue:
            raise ExperimentError("this is no fix of the check", advice="reload the page") from None
        except (KeyError, IndexError):
            raise Changed(
                "the check has another result by now", advice="it is shown as it is"
            ) from None
        self.projects.write(project, edited(text, chosen.edits), version)

    def repair(self, project: Project, run: str, number: int, version: str) -> None:
        """Apply a repair that the verdict of a run has tried.

        Args:
            project: whose.
            run: number of the run.
            number: of the repair in its verdict.
            version: of the text that the page shows.

        Raises:
            Changed: the file is no longer the one that the page shows, or the verdict is about.
            PividentError: there is no such run or repair, or the file contradicts it.
        """
        project.text_of(version)
        new, _ = repaired_text(project, RunFolder.of(project.folder, run).results, number)
        self.projects.write(project, new, version)

    def write_laws(self, project: Project, run: str, version: str) -> None:
        """Write the friction laws that a run has chosen into the experiment file.

        Args:
            project: whose.
            run: number of the run.
            version: of the text that the page shows.

        Raises:
            Changed: the file is no longer the one that the page shows.
            PividentError: there is no such run, or it has chosen none.
        """
        results = RunFolder.of(project.folder, run).results
        self.projects.write(project, with_laws(project.text_of(version), results), version)

    def can_undo(self, project: Project) -> bool:
        """Whether the last change can be taken back; a draft itself cannot: it is made again."""
        earlier = self.projects.earlier_text(project)
        was, now = Content(earlier).has_recording, Content(project.text).has_recording
        return bool(earlier) and (was or not now)

    def undo(self, project: Project) -> None:
        """Take the last change of the experiment file back.

        Raises:
            ProjectError: there is none.
        """
        if not self.can_undo(project):
            raise ProjectError("there is no change of the experiment file to take back")
        self.projects.undo(project)

    def removed(self, project: Project) -> None:
        """A file has been removed: a draft that failed, perhaps because of it, is made anew."""
        if self.drafted(project).get("error"):
            (project.hidden / DRAFT).unlink(missing_ok=True)

    def run(
        self, project: Project, step: str, arguments: Mapping[str, Any], go_on: bool = False
    ) -> str:
        """Queue a step of the way.

        Args:
            project: whose.
            step: name of one of `pivident.app.studio.steps.STEPS`.
            arguments: of the step.
            go_on: whether somebody who knows what is said against it wants it all the same.

        Returns:
            The number of the run.

        Raises:
            ProjectError: it would stop; or it would mislead, and nobody has said to go on.
            StepError: an argument is not possible.
        """
        if step not in STEPS:
            raise ProjectError(f"there is no step {step!r}")
        gate = before_use(project.folder, step, arguments)
        if step == "identify":
            if arguments.get("method") == []:
                raise ProjectError("no method is chosen", advice="tick at least one")
            gate = self.gate(project)
        if gate.reason and not (go_on and gate.against):
            raise ProjectError(gate.reason)
        return self.runs.add(project.folder, step, arguments, gate.against)

    def gate(self, project: Project) -> Gate:
        """What holds an identification of a project back."""
        look, folder = self.looks.state(project.folder), self.looks.folder(project.folder)
        check = read_object(folder / "findings" / "check.json")
        return before_run(Content(project.text).has_recording, look, check)

    @staticmethod
    def _task(project: Project) -> str:
        return f"draft {project.folder}"
