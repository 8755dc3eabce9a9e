"""What a remark of the check asks for as edits of the experiment file, ready to be applied.

A remark carries its repairs as data; here they become the buttons beside it. Those that the file
contradicts are left out, and a remark that leaves open what is right has none.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from pivident.experiment.edited_file import Edits, edited, edits_for
from pivident.foundation.errors import ExperimentError, PividentError
from pivident.foundation.text.repair import Place, Repair


@dataclass(frozen=True)
class Fix:
    """One way to do what a remark asks for.

    Attributes:
        words: what is done, a sentence.
        edits: place and new value as TOML, in their order; None: removed.
    """

    words: str
    edits: Edits


def fixes(remark: Mapping[str, Any], text: str) -> tuple[Fix, ...]:
    """Ways to do what a remark asks for, the most likely first; empty where none is definite.

    Each has been tried on the text.

    Args:
        remark: an entry of ``check.json``, with ``joints``, the names of the robot's joints.
        text: the experiment file that was checked.
    """
    ways: list[Fix] = []
    for content in remark.get("repairs", ()):
        try:
            repair = Repair.of_json(content)
            fix = Fix(*edits_for(repair, text, tuple(remark.get("joints", ()))))
            works = edited(text, fix.edits) != text
        except (PividentError, ValueError):
            continue
        if works and all(fix.edits != other.edits for other in ways):
            ways.append(fix)
    return tuple(ways)


def as_json(fix: Fix) -> dict[str, Any]:
    """A fix as plain values."""
    return {"words": fix.words, "edits": [[list(place), value] for place, value in fix.edits]}


def of_json(content: Mapping[str, Any]) -> Fix:
    """A fix from `as_json`, as a page sends it back.

    Raises:
        ExperimentError: it has another form.
    """
    try:
        edits = tuple((_place(place), _value(value)) for place, value in content["edits"])
        return Fix(str(content["words"]), edits)
    except (KeyError, TypeError, ValueError):
        raise ExperimentError("this is no fix of the check", advice="reload the page") from None


def _place(place: Any) -> Place:
    if not isinstance(place, list) or not all(isinstance(part, (str, int)) for part in place):
        raise TypeError
    return tuple(place)


def _value(value: Any) -> str | None:
    if value is not None and not isinstance(value, str):
        raise TypeError
    return value
