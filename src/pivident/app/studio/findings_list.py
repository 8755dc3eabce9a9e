"""What the check has found, each with its fixes and the line that it is about."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from pivident.app.studio.rows import Row, channel_of
from pivident.experiment.check.plan import Plan
from pivident.foundation.text.repair import Place
from pivident.foundation.text.sentences import plural

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
    if not stored:
        return []
    return Plan(**{k: _tuples(v) for k, v in stored.items()}).lines


def _tuples(value: Any) -> Any:
    return tuple(map(_tuples, value)) if isinstance(value, list) else value
