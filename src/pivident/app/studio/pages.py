"""What the pages show: pieces, each from files, with a key that tells a new one from an old."""

from __future__ import annotations

import hashlib
import shlex
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from markupsafe import Markup

from pivident.app.studio.assets import templates
from pivident.app.studio.drafting import ROBOT
from pivident.app.studio.gate import check_context
from pivident.app.studio.projects import (
    RESULTS,
    TEST_LOGS,
    Content,
    Project,
    ProjectError,
    is_robot,
)
from pivident.app.studio.results_list import clock, result_context
from pivident.app.studio.row_groups import row_groups
from pivident.app.studio.rows import addable
from pivident.app.studio.run_folder import read_object
from pivident.app.studio.studio import Studio
from pivident.app.studio.view import View, method_context
from pivident.data.logs.tables.tables import is_log
from pivident.foundation.text.numbers import bytes_in_words
from pivident.foundation.text.plain_values import strict_json
from pivident.foundation.text.sentences import plural
from pivident.foundation.version import __version__
from pivident.robot.gallery import gallery_names

#: Names for new examples.
EXAMPLE = "example"


@dataclass(frozen=True)
class Piece:
    """A piece of the page that changes as a whole.

    Attributes:
        name: its name; its template is ``NAME.html``.
        part: the step that it belongs to.
        key: what it follows from.
        context: what its template shows.
        mark: what the list of steps shows beside the step; ``-`` leaves it to others.
    """

    name: str
    part: str
    key: Callable[[View], Any]
    context: Callable[[View], dict[str, Any]]
    mark: Callable[[View], str] = lambda view: "-"

    def key_of(self, view: View) -> str:
        """A short text that is another one where the piece is."""
        text = strict_json([__version__, self.key(view)])
        return hashlib.sha256(text.encode("utf-8", "surrogateescape")).hexdigest()[:16]


def _files(view: View) -> dict[str, Any]:
    """Files, robot, the draft and its questions."""
    robot, draft = view.content.robot, view.draft
    untouched = bool(view.text) and view.text == draft.get("text")
    busy = view.draft_task["state"] == "running"
    failed = view.draft_task["error"] if view.draft_task["state"] == "failed" else ""
    logs = view.studio.logs(view.project)
    return {
        "files": [
            {
                "path": name,
                "size": bytes_in_words(size),
                "kind": _kind(name),
                "used": name in view.named,
            }
            for name, size, _ in view.files
        ],
        "robot": robot,
        "robots": [name for name, _, _ in view.files if is_robot(Path(name))],
        "gallery": gallery_names(),
        "drafting": (view.draft_task["line"] or "starting") if busy else "",
        "draft_error": "" if busy else failed or draft.get("error", ""),
        "troubles": _troubles(view) if untouched and not busy else [],
        "questions": draft.get("questions", []) if untouched and not busy else [],
        "may_draft": bool(robot and logs) and not busy,
        "may_simulate": robot == ROBOT and not logs and not busy,
        "has_recording": view.content.has_recording,
        "edited": view.content.has_recording and not untouched,
    }


def _kind(name: str) -> str:
    """What a file is, by its name."""
    if is_robot(Path(name)):
        return "robot"
    if name.startswith(f"{TEST_LOGS}/"):
        return "log for tests"
    return "log" if is_log(name) else "other"


def _troubles(view: View) -> list[str]:
    """What the draft could not settle; logs that were left out as long as they are there."""
    there = {name for name, _, _ in view.files}
    left_out = view.draft.get("left_out", {})
    return [
        *(f"{log} is left out: {why}" for log, why in left_out.items() if log in there),
        *view.draft.get("troubles", []),
    ]


def _motion(view: View) -> dict[str, Any]:
    """The arm, moved as logged or joint by joint."""
    found = read_object(view.folder / "signals" / "motion.json") if view.has("signals") else {}
    busy = view.look["line"] if view.look["signals"] == "running" else ""
    error = view.signals.get("error", "") if not found.get("joints") else ""
    error = error or (view.look["error"] if view.look["signals"] == "failed" else "")
    shown = found if found.get("joints") and view.content.robot else None
    robot = None
    if shown:
        joints = [SimpleNamespace(name=found["joints"][i]["name"]) for i in found["rows"]]
        robot = SimpleNamespace(name=view.content.robot, size=len(joints), joints=joints)
    return {
        "motion": shown,
        "robot": robot,
        "logged": bool(found.get("logged")),
        "drafting": view.draft_task["state"] == "running",
        "busy": busy or ("reading" if view.look["signals"] == "running" else ""),
        "error": error if view.text else "",
    }


def _assumptions(view: View) -> dict[str, Any]:
    """Lines of the experiment file beside the signals that they are about."""
    if not view.text:
        return {"groups": [], "raw": "", "undo": view.studio.can_undo(view.project)}
    assumed = sum(row.sure == "assumed" for row in view.rows)
    none = "Nothing is assumed." if view.content.has_recording else "The log is not described yet."
    many = {0: none, 1: "1 line is an assumption, please check it."}
    return {
        "groups": row_groups(view.rows, view.signals),
        "addable": addable(view.text) if view.rows else (),
        "counted": many.get(assumed, f"{assumed} lines are assumptions, please check them."),
        "undo": view.studio.can_undo(view.project),
        "raw": view.text,
    }


def _assumed(view: View) -> str:
    """How many lines are assumptions."""
    assumed = sum(row.sure == "assumed" for row in view.rows)
    return f"{assumed} to check" if assumed else ""


def _share(view: View) -> dict[str, Any]:
    """The archive, and the commands that do the same."""
    results = sum(file["bytes"] for run in view.runs for file in run["files"])
    logs = sum(size for name, size, _ in view.files if is_log(name))
    commands = []
    if view.content.has_recording:
        used = [n for n in view.studio.logs(view.project) if n in view.named]
        changed = view.text != view.draft.get("text")
        commands = [
            f"pivident init {' '.join(map(_quoted, used))} --robot {_quoted(view.content.robot)}",
            *["# the experiment file was changed by hand after this"] * changed,
            "pivident check experiment.toml",
            *reversed([run["command"] for run in view.runs if run["state"] == "done"]),
        ]
    return {
        "folder": str(view.project.folder),
        "logs_size": bytes_in_words(logs),
        "results_size": bytes_in_words(results),
        "commands": commands,
    }


def _check_mark(view: View) -> str:
    """Errors and warnings as a number each."""
    remarks = view.check.get("remarks", []) if view.content.has_recording else []
    errors = sum(r["severity"] == "error" for r in remarks)
    warnings = sum(r["severity"] == "warning" for r in remarks)
    counted = [f"{mark}{many}" for mark, many in (("×", errors), ("!", warnings)) if many]
    if counted:
        return " ".join(counted)
    return "✓" if view.check and not view.check.get("error") and view.content.has_recording else ""


def _runs_mark(view: View) -> str:
    """Whether something is running."""
    active = sum(run["state"] == "running" for run in view.runs)
    return f"{active} running" if active else f"({len(view.runs)})" if view.runs else ""


#: The steps in their order.
PARTS = {
    "files": "Robot and logs",
    "assumptions": "Assumptions and signals",
    "checks": "Checks",
    "run": "Run",
    "results": "Results",
    "share": "Share and repeat",
}

#: The pieces of the page in their order.
PIECES = {
    piece.name: piece
    for piece in (
        Piece(
            "files",
            "files",
            lambda v: [v.files, v.version, v.draft_task, v.draft],
            _files,
            lambda v: "✓" if v.content.has_recording else "",
        ),
        Piece(
            "motion",
            "assumptions",
            lambda v: (
                [_signals_key(v), v.look["signals"], v.content.robot, v.look["error"]]
                + [v.draft_task["state"]]
                + ([v.look["line"]] if v.look["signals"] == "running" else [])
            ),
            _motion,
        ),
        Piece(
            "assumptions",
            "assumptions",
            lambda v: [v.version, _signals_key(v)],
            _assumptions,
            _assumed,
        ),
        Piece(
            "checks",
            "checks",
            lambda v: [v.version, v.look],
            lambda v: check_context(v.rows, v.check, v.look, v.folder, v.content.has_recording),
            _check_mark,
        ),
        Piece(
            "run",
            "run",
            lambda v: [
                v.version,
                asdict(v.gate),
                (v.check.get("plan") or {}).get("seconds"),
                [run["id"] for run in v.runs if run["state"] == "done"],
            ],
            lambda v: {"gate": v.gate} | method_context(v.content, v.check, v.runs),
            lambda v: "ready" if not v.gate.reason else "",
        ),
        Piece(
            "results",
            "results",
            lambda v: [v.runs, v.version, v.files, asdict(v.gate)],
            lambda v: (
                {"gate": v.gate}
                | result_context(v.project, v.runs, v.address, v.content.content, v.named, v.rows)
            ),
            _runs_mark,
        ),
        Piece("share", "share", lambda v: [v.files, v.runs, v.version], _share),
    )
}


def _signals_key(view: View) -> Any:
    """What the signals follow from, as long as they are there."""
    key = view.folder / "signals" / "key"
    return key.read_text(encoding="utf-8") if view.has("signals") and key.is_file() else ""


def project_page(studio: Studio, project: Project) -> str:
    """The whole page of a project."""
    view = View(studio, project)
    parts = [
        {
            "name": name,
            "title": title,
            "pieces": [_piece(view, piece) for piece in PIECES.values() if piece.part == name],
        }
        for name, title in PARTS.items()
    ]
    return _render(
        "project.html",
        name=project.name,
        address=view.address,
        single=studio.projects.is_single,
        parts=parts,
    )


def _piece(view: View, piece: Piece) -> dict[str, Any]:
    """A piece as the page and a later request show it."""
    context = {"address": view.address, "version": view.version, **piece.context(view)}
    return {
        "name": piece.name,
        "part": piece.part,
        "key": piece.key_of(view),
        "mark": piece.mark(view),
        "html": Markup(templates().get_template(f"{piece.name}.html").render(context)),
    }


def one_piece(studio: Studio, project: Project, name: str) -> str:
    """A piece of the page as it is now.

    Raises:
        ProjectError: there is no such piece.
    """
    if name not in PIECES:
        raise ProjectError(f"there is no part {name!r}", advice="reload the page")
    return (
        templates()
        .get_template("piece.html")
        .render(piece=_piece(View(studio, project), PIECES[name]))
    )


def state(studio: Studio, project: Project) -> dict[str, Any]:
    """Key of every piece, and whether they are going to change soon."""
    view = View(studio, project)
    keys = {name: piece.key_of(view) for name, piece in PIECES.items()}
    return {"keys": keys, "busy": view.is_busy}


def front_page(studio: Studio) -> str:
    """All projects."""
    taken = {project.name for project in studio.projects.listed()}
    names = (EXAMPLE, *(f"{EXAMPLE} {k}" for k in range(2, len(taken) + 3)))
    return _render(
        "front.html",
        root=str(studio.projects.root),
        example_name=next(name for name in names if name not in taken),
        projects=[
            {
                "name": project.name,
                "address": studio.address(project),
                "words": ", ".join(_about(project)),
                "changed": clock(project.changed),
            }
            for project in studio.projects.listed()
        ],
    )


def _about(project: Project) -> Iterator[str]:
    """A project in words: its robot and how many results it has."""
    try:
        robot = Content(project.text).robot
    except ProjectError as error:
        yield str(error)
        return
    yield robot or "no robot yet"
    results = project.folder / RESULTS
    yield plural(sum(p.is_dir() for p in results.iterdir()) if results.is_dir() else 0, "result")


def _quoted(name: str) -> str:
    """A name as a shell takes it."""
    return shlex.quote(f"./{name}" if name.startswith("-") else name)


def _render(template: str, **context: Any) -> str:
    return templates().get_template(template).render(version=__version__, **context)
