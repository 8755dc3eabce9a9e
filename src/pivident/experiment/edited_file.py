"""Values of an experiment file changed, added or removed; every other line stays as it is.

`tomlkit` keeps comments, order and format. A comment says that a line was set by hand, and what
stood there before with its reason. That nothing else has changed is verified by the parser,

    parsed(new text) = parsed(old text) with the value at its place,

and of several ways to write a key that was not there, the first that fulfils this is taken.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from typing import Any

import tomlkit
from tomlkit.exceptions import TOMLKitError

from pivident.experiment.edited_lines import (
    called,
    comment_lines,
    content_of,
    document_of,
    line_at,
    short,
    table_name,
    ways_to_add,
    with_ends,
    with_value,
    without,
    without_tables,
)
from pivident.experiment.explained import every_problem, plain_form
from pivident.experiment.file_lines import numbered, sureness
from pivident.experiment.repairs import FileContent, edits_of
from pivident.foundation.errors import ExperimentError
from pivident.foundation.text.repair import Place, Repair
from pivident.foundation.text.toml import parse_toml, value_text

#: Places and their new values as TOML, in their order; None: removed.
Edits = tuple[tuple[Place, str | None], ...]

#: What the comment of a line says that somebody has found right, with the assumption behind it.
CONFIRMED = "Confirmed by hand"


def edited(text: str, edits: Sequence[tuple[Sequence[int | str], str | None]]) -> str:
    """The text with values that are changed, added or removed.

    A removed key stays as a suggestion in a comment.

    Args:
        text: an experiment file.
        edits: places and their new values as TOML, in their order; None: removed. A place is tables
            and keys, as the check has them.

    Raises:
        ExperimentError: text or value are not TOML, a key is not known or cannot have its value,
            there is no such table or key, or the rest is incomplete.
    """
    new = text
    for place, value in edits:
        new = _changed(new, numbered(place), value)
    _refuse_new_problems(text, new)
    return new


def confirmed(text: str, place: Sequence[int | str]) -> str:
    """The text with an assumption that somebody has found right: its comment says so.

    A gain that is said to be ``scale = "assumed"`` is known from now on.

    Args:
        text: an experiment file.
        place: tables and key of the assumption.

    Raises:
        ExperimentError: the text is not TOML, or there is no such assumption.
    """
    place = numbered(place)
    document = document_of(text)
    spot = line_at(document, place)
    line = None if spot is None else spot[0]
    if line is None or sureness(line.reason)[0] != "assumed":
        raise ExperimentError(
            f"{called(place)} is no assumption any more", advice="reload the page"
        )
    words = f"{CONFIRMED} ({line.reason.rstrip('.')})."
    line.body[line.start : line.number] = comment_lines(words, text)
    content = content_of(text)
    new = _verified([document.as_string()], [content], place)
    for scale in _assumed_scales(FileContent(content, ()).value(*place), place):
        new = _changed(new, scale, None)
    return new


def edits_for(repair: Repair, text: str, joints: tuple[str, ...]) -> tuple[str, Edits]:
    """What a repair does to a text, a sentence, and its edits.

    Args:
        repair: of the recording in its table.
        text: an experiment file.
        joints: names of the robot's joints, in order.

    Raises:
        ExperimentError: it contradicts the file, or the text is not TOML.
    """
    whole = edits_of(repair, FileContent(content_of(text), joints))
    edits = tuple((place, None if x is None else value_text(x)) for place, x in whole.edits)
    return whole.words, edits


def with_repair(text: str, repair: Repair, joints: tuple[str, ...]) -> tuple[str, str]:
    """The text with a repair of the verdict in all its recordings, and what was done, a sentence.

    Args:
        text: the experiment file that was identified.
        repair: one that was tried.
        joints: names of the robot's joints, in order.

    Raises:
        ExperimentError: it contradicts the file, or the text is not TOML.
    """
    words = ""
    for table in range(len(content_of(text).get("recording", ()))):
        words, edits = edits_for(repair.below(("recording", table)), text, joints)
        text = edited(text, edits)
    return text, words


def _changed(text: str, place: Place, value: str | None) -> str:
    """The text with a value, or without one, at a numbered place; the schema is not asked."""
    content = content_of(text)
    if value is None:
        try:  # the last dotted key takes its table along
            wanted = [_without(content, place, lonely=lonely) for lonely in (False, True)]
        except (AttributeError, LookupError, TypeError):
            raise ExperimentError(
                f"{called(place)} is not in the file", advice="reload the page"
            ) from None
        return _verified([without(text, place)], wanted, place)
    value = with_ends(_checked_value(value.strip(), place), text)
    new = parse_toml(f"x = {value}")["x"]
    try:
        wanted = [plain_form(_with(content, place, new))]
    except LookupError:
        raise ExperimentError(
            f"{called(place)} has no table to stand in", advice="add the table as text"
        ) from None
    old = FileContent(content, ()).value(*place)
    replaced = with_value(text, place, value)
    if replaced is not None:
        return _verified([replaced], wanted, place)
    changes = _changes(old, new)
    if changes is not None:  # tables with headers
        for part, inner in changes.items():
            text = _changed(text, (*place, part), None if inner is None else value_text(inner))
        return text
    before = "not set" if old is None else short(value_text(old))
    rest = text if old is None else without_tables(document_of(text), place)
    return _verified(ways_to_add(rest, place, value, before), wanted, place)


def _changes(old: Any, new: Any) -> dict[int | str, Any] | None:
    """What differs between two tables, or two lists of one length; None where they are neither."""
    if isinstance(old, list) and isinstance(new, list) and len(old) == len(new):
        old, new = dict(enumerate(old)), dict(enumerate(new))
    if not (isinstance(old, dict) and isinstance(new, dict)):
        return None
    return {part: new.get(part) for part in old | new if old.get(part) != new.get(part)}


def _checked_value(value: str, place: Place) -> str:
    """A value that is one value and nothing else."""
    try:
        parse_toml(f"x = {value}")
        tomlkit.value(value)
        return value
    except TOMLKitError:
        reason = "more than one value"
    except ValueError as error:
        reason = str(error)
    raise ExperimentError(
        f"{called(place)}: {short(value)} is not a value of TOML ({reason})",
        advice="texts stand in "
        'quotation marks, lists in brackets, numbers have a point: "rad", [1.5, 2.0]',
    )


def _verified(ways: Iterable[str], wanted: Sequence[Any], place: Place) -> str:
    """The first text that says what is wanted."""
    with suppress(TOMLKitError):  # the same key twice
        for text in ways:
            with suppress(ValueError):
                if plain_form(parse_toml(text)) in wanted:
                    return text
    raise ExperimentError(
        f"{called(place)} cannot be changed here",
        advice="open the file as text and change it there",
    )


def _assumed_scales(value: Any, place: Place) -> Iterator[Place]:
    """Where a value says of a gain in it that it is assumed."""
    if isinstance(value, dict) and value.get("scale") == "assumed":
        yield (*place, "scale")
    numbers = enumerate(value) if isinstance(value, list) else ()
    for part, inner in value.items() if isinstance(value, dict) else numbers:
        yield from _assumed_scales(inner, (*place, part))


def _refuse_new_problems(old: str, new: str) -> None:
    """Refuse what the schema finds wrong with a text and not with an older one."""
    before, after = (every_problem(content_of(text)) for text in (old, new))
    old_problems = {(p.location, str(p.said)) for p in before}
    for problem in after:
        if (problem.location, str(problem.said)) not in old_problems:
            heading = table_name(problem.location)
            raise ExperimentError.of_part(f"[{heading}] " if heading else "", problem.said)


def _with(table: Any, place: Place, value: Any) -> Any:
    """Tables or a list with a value at a place.

    Raises:
        LookupError: there is no table for it.
    """
    part, rest = place[0], place[1:]
    if not (isinstance(table, dict) or (isinstance(table, list) and part in range(len(table)))):
        raise LookupError
    new: Any = table.copy()
    inner = table.get(part, {}) if isinstance(table, dict) else new[part]
    new[part] = _with(inner, rest, value) if rest else value
    return new


def _without(table: Any, place: Place, *, lonely: bool) -> Any:
    """Tables or a list without a place; an empty list goes with it, and where asked for a table."""
    part, rest = place[0], place[1:]
    inner = _without(table[part], rest, lonely=lonely) if rest else None
    new = table.copy()
    if inner or (isinstance(inner, dict) and not lonely):
        new[part] = inner
    else:
        del new[part]
    return new
