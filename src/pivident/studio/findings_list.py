"""What the check has found, each with its fixes and the line that it is about."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from pivident.check.plan import Plan
from pivident.studio.rows import Row
from pivident.text.lists import plural

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
    places = {row.place for row in rows}
    shown = [
        _remark(number, remark, places)
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


def _remark(
    number: int, remark: dict[str, Any], places: set[tuple[str | int, ...]]
) -> dict[str, Any]:
    """A finding with its number, buttons, and the line to go to."""
    place = tuple(remark["place"])
    while place and place not in places:
        place = place[:-1]
    if not place:  # the first line of its table
        inside = [p for p in places if remark["place"] and p[:1] == tuple(remark["place"][:1])]
        place = min(inside, default=(), key=lambda p: tuple(map(str, p)))
    return {
        **remark,
        "number": number,
        "fixes": [fix["words"] for fix in remark.get("fixes", ())],
        "row": "row-" + ".".join(map(str, place)) if place else "",
        "heading": f"[{place[0]}] {'.'.join(p for p in place[1:] if isinstance(p, str))}".rstrip()
        if place
        else "",
    }


def _plan(stored: dict[str, Any] | None) -> list[tuple[str, str]]:
    """The plan as lines of a key and its words."""
    if not stored:
        return []
    return Plan(**{k: _tuples(v) for k, v in stored.items()}).lines


def _tuples(value: Any) -> Any:
    return tuple(map(_tuples, value)) if isinstance(value, list) else value
