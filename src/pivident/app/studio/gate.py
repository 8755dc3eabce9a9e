"""What is held back because it would be wrong; whoever goes on all the same is not stopped.

A run is held back by errors of the check, the use of a result by a verdict that rejects this use.
What was said against it stays with the result: on its card, in its ``run.json``, in its exports.

What the check has found, each with its fixes and the line that it is about.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pivident.app.studio.rows import Row, channel_of
from pivident.app.studio.run_folder import ACCOUNT, read_object
from pivident.app.studio.step_arguments import StepError, result_folder
from pivident.experiment.check.plan import Plan
from pivident.foundation.text.plain_values import lists_as_tuples
from pivident.foundation.text.repair import Place
from pivident.foundation.text.sentences import plural
from pivident.judgement.diagnostics.stored_verdict import VERDICT_FILE, rejected_uses

#: Formats for simulators, which need parameters that a machine can have.
SIMULATED = ("urdf", "mjcf", "sdf")

#: Longest way from a derived result to its identification.
MAX_STEPS = 5


@dataclass(frozen=True)
class Gate:
    """Whether something is held back.

    Attributes:
        reason: why, a sentence; empty where nothing is held back.
        against: sentences that a result remembers which is made all the same; none where nobody
            can go on.
    """

    reason: str = ""
    against: tuple[str, ...] = ()


def before_run(has_recording: bool, look: Mapping[str, str], check: Mapping[str, Any]) -> Gate:
    """What holds an identification back.

    Args:
        has_recording: whether the experiment file describes a log.
        look: state of the look at it.
        check: content of its ``check.json``; empty before there is one.
    """
    if not has_recording:
        return Gate("A robot and a log are needed first.")
    if look["findings"] == "failed":
        return Gate(f"The check has failed: {look['error']}")
    if look["findings"] != "ready":
        return Gate("The check has not finished yet.")
    if check.get("error"):
        return Gate("The experiment file cannot be read; see Checks.")
    if check.get("refused"):
        return Gate("First fix what is marked × under Checks: it would stop a run.")
    errors = [r["message"] for r in check.get("remarks", ()) if r["severity"] == "error"]
    if not errors:
        return Gate()
    return Gate("What is marked × under Checks would mislead a run.", tuple(errors))


def before_use(project: Path, step: str, arguments: Mapping[str, Any]) -> Gate:
    """What holds the use of a result back: a verdict that rejects it.

    Args:
        project: folder of the project.
        step: what the result is used for.
        arguments: of the step; one that cannot be carried out is refused elsewhere.
    """
    if step not in ("consistent", "export"):
        return Gate()
    try:
        rejected = rejected_uses(_judged(project, str(arguments.get("result"))))
    except StepError:
        return Gate()
    if step == "export" and arguments.get("to") not in (None, *SIMULATED):
        rejected.pop("simulation", None)
    return Gate(next(iter(rejected.values()), ""), tuple(rejected.values()))


def _judged(project: Path, result: str) -> Path:
    """Folder of the identification that a result follows from."""
    folder = project / result_folder(project, result)
    for _ in range(MAX_STEPS):
        folder = folder if folder.is_dir() else folder.parent
        arguments = read_object(folder / ACCOUNT).get("arguments")
        if (folder / VERDICT_FILE).is_file() or not isinstance(arguments, dict):
            break
        if not isinstance(made_from := arguments.get("result"), str):
            break
        folder = project / result_folder(project, made_from)
    return folder


#: Severities from grave to harmless; what is right is not listed.
SHOWN = ("error", "warning", "note")


def check_context(
    rows: Sequence[Row],
    check: dict[str, Any],
    look: dict[str, str],
    folder: Path,
    has_recording: bool,
) -> dict[str, Any]:
    """What the section of checks shows.

    Args:
        rows: lines of the experiment file.
        check: content of ``check.json``; empty before there is one.
        look: state of the look.
        folder: of the look.
        has_recording: whether there is a log to check.
    """
    busy = look["findings"] == "running"
    remarks = check.get("remarks", [])
    shown = [
        _remark(number, remark, rows)
        for number, remark in enumerate(remarks)
        if remark["severity"] in SHOWN
    ]
    return {
        "applies": has_recording,
        "busy": (look["line"] or "starting") if busy else "",
        "error": check.get("error", "") or (look["error"] if look["findings"] == "failed" else ""),
        "headline": "" if check.get("error") else _headline(check),
        "severity": "error" if check.get("refused") else check.get("severity", "ok"),
        "remarks": shown,
        "several_fixes": sum(bool(remark["fixes"]) for remark in shown) > 1,
        "audited": (folder / "findings" / "audit.html").is_file(),
        "plan": _plan(check.get("plan")),
    }


def _headline(check: dict[str, Any]) -> str:
    """The check in a sentence; empty before there is one."""
    if not check:
        return ""
    counts = {s: sum(r["severity"] == s for r in check["remarks"]) for s in SHOWN}
    counted = " and ".join(plural(counts[s], s) for s in ("error", "warning") if counts[s])
    if check["refused"]:
        return f"A run would stop: {counted}."
    if counts["error"]:
        return f"A run would give wrong results: {counted}."
    return f"Ready to run, with {counted}." if counted else "Ready to run."


def _line(place: Place, rows: Sequence[Row]) -> Place:
    """The line that is nearest to a place: itself, one around it, of its signal, of its table."""
    places = [row.place for row in rows]
    for size in range(len(place), 0, -1):
        if place[:size] in places:
            return place[:size]
    channel = channel_of(place) if place else ""
    near = [row.place for row in rows if channel and row.channel == channel]
    return next(iter(near + [p for p in places if place and p[0] == place[0]]), Place())


def line_to_go_to(place: Place, rows: Sequence[Row]) -> dict[str, str]:
    """The line that is about a place of the experiment file, and its heading; both may be empty.

    Args:
        place: keys of tables, and numbers of their repetitions.
        rows: lines of the file.
    """
    if not (place := _line(place, rows)):
        return {"row": "", "heading": ""}
    keys = ".".join(part for part in place[1:] if isinstance(part, str))
    return {"row": "row-" + ".".join(map(str, place)), "heading": f"[{place[0]}] {keys}".rstrip()}


def _remark(number: int, remark: dict[str, Any], rows: Sequence[Row]) -> dict[str, Any]:
    """A finding with its number, buttons, and the line to go to."""
    fixes = [fix["words"] for fix in remark.get("fixes", ())]
    return {
        **remark,
        "number": number,
        "fixes": fixes,
        **line_to_go_to(tuple(remark["place"]), rows),
    }


def _plan(stored: dict[str, Any] | None) -> list[tuple[str, str]]:
    """The plan as lines of a key and its words."""
    return Plan(**{k: lists_as_tuples(v) for k, v in stored.items()}).lines if stored else []
