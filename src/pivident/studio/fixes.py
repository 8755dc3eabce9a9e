"""What a remark of the check asks for as edits of the experiment file, ready to be applied.

A remark carries its repairs as data; here they become the buttons beside it. Those that the file
contradicts are left out, and a remark that leaves open what is right has none.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from pivident.errors import ExperimentError, PividentError
from pivident.experiment.explained import plain_form
from pivident.experiment.repairs import FileContent, edits_of
from pivident.studio.edits import changed, refuse_new_problems
from pivident.text.repair import Place, Repair
from pivident.text.toml import parse_toml
from pivident.text.toml_values import value_text

#: Places and their new values as TOML, in their order; None: removed.
Edits = tuple[tuple[Place, str | None], ...]


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
            fix = fix_of(Repair.of_json(content), text, tuple(remark.get("joints", ())))
            works = applied(text, fix) != text
        except (PividentError, ValueError):
            continue
        if works and all(fix.edits != other.edits for other in ways):
            ways.append(fix)
    return tuple(ways)


def fix_of(repair: Repair, text: str, joints: tuple[str, ...]) -> Fix:
    """A repair as edits of a text.

    Args:
        repair: of the recording in its table.
        text: an experiment file.
        joints: names of the robot's joints, in order.

    Raises:
        ExperimentError: it contradicts the file.
        ValueError: the text is not TOML.
    """
    whole = edits_of(repair, FileContent(plain_form(parse_toml(text)), joints))
    edits = tuple((place, None if x is None else value_text(x)) for place, x in whole.edits)
    return Fix(whole.words, edits)


def applied(text: str, fix: Fix) -> str:
    """The text with all edits of a fix.

    Raises:
        ExperimentError: the text has changed since, so that it cannot be applied.
    """
    new = text
    for place, value in fix.edits:
        new = changed(new, place, value)
    refuse_new_problems(text, new)
    return new


def with_repair(text: str, repair: Repair, joints: tuple[str, ...]) -> tuple[str, str]:
    """The text with a repair of the verdict in all its recordings, and what was done, a sentence.

    Args:
        text: the experiment file that was identified.
        repair: one that was tried.
        joints: names of the robot's joints, in order.

    Raises:
        ExperimentError: it contradicts the file.
        ValueError: the text is not TOML.
    """
    words = ""
    for table in range(len(plain_form(parse_toml(text)).get("recording", ()))):
        fix = fix_of(repair.below(("recording", table)), text, joints)
        text, words = applied(text, fix), fix.words
    return text, words


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
