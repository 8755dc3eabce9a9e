"""One value of an experiment file changed, added or removed; every other byte stays as it is.

The text is cut at the value and put together again, so that comments, order and format remain. A
line says that it was set by hand, and what stood there before with its reason. That nothing else
has changed is verified by the parser,

    parsed(new text) = parsed(old text) with the value at its place,

and of several ways to write a key that was not there, the first that fulfils this is taken.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any

from pivident.errors import ExperimentError
from pivident.experiment.explained import every_problem, plain_form
from pivident.init.assumption import SURE
from pivident.studio.changed_content import (
    added_ways,
    called,
    comment_lines,
    content_with,
    content_without,
    find_item,
    is_below,
    is_head,
    with_ends,
    without_empty_tables,
)
from pivident.studio.comments import (
    BY_HAND,
    Comment,
    comments,
    line_start,
    next_line,
    sureness,
)
from pivident.studio.key_words import numbered
from pivident.studio.rows import checked_items, table_name
from pivident.text.toml import parse_toml
from pivident.text.toml_places import Place, TomlItem, toml_items

#: Longest old value that its comment repeats, in characters.
MAX_VALUE = 200

#: What the comment of a line says that somebody has found right, with the assumption behind it.
CONFIRMED = "Confirmed by hand"

#: What the comment of a key says that somebody has removed, which is then only suggested.
REMOVED = "Removed by hand."


def with_value(text: str, place: Sequence[int | str], value: str) -> str:
    """The text with another value, or with one more key.

    Args:
        text: an experiment file.
        place: tables and keys, as a `Row` or a remark of the check has them.
        value: as TOML.

    Raises:
        ExperimentError: text or value are not TOML, the key is not known or cannot have this
            value, or there is no such table.
    """
    new = changed(text, place, value)
    refuse_new_problems(text, new)
    return new


def without(text: str, place: Sequence[int | str]) -> str:
    """The text without a key, which stays as a suggestion in a comment, or without a table.

    Args:
        text: an experiment file.
        place: tables and keys, as a `Row` or a remark of the check has them.

    Raises:
        ExperimentError: the text is not TOML, there is no such key, or the rest is incomplete.
    """
    new = changed(text, place, None)
    refuse_new_problems(text, new)
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
    items = checked_items(text)
    item = find_item(text, items, place)
    above = None if item is None else _comment_above(text, _line_of(items, item))
    if above is None or sureness(above.text)[0] != "assumed":
        raise ExperimentError(
            f"{called(place)} is no assumption any more", advice="reload the page"
        )
    words = comment_lines(f"{CONFIRMED} ({above.text.rstrip('.')}).", text)
    new = text[: above.start] + words + text[above.stop :]
    new = _verified([new], plain_form(parse_toml(text)), place)
    while (scale := _assumed_scale(new, place)) is not None:
        new = changed(new, scale, None)
    return new


def changed(text: str, place: Sequence[int | str], value: str | None) -> str:
    """As `with_value`, or `without` where there is no value; the schema is not asked."""
    place = numbered(place)
    if value is None:
        return _removed(text, place)
    value = with_ends(_checked_value(value.strip(), place), text)
    items = checked_items(text)
    item = find_item(text, items, place)
    if item is not None:
        if text[item.value : item.stop] == value:
            return text
        made = [_replaced(text, items, item, value)]
    else:
        made = list(added_ways(text, items, place, value))
    wanted = content_with(plain_form(parse_toml(text)), place, parse_toml(f"x = {value}")["x"])
    return _verified(made, wanted, place)


def refuse_new_problems(old: str, new: str) -> None:
    """Refuse what the schema finds wrong with a text and not with an older one.

    Raises:
        ExperimentError: names table, key and the next step.
    """
    before, after = (every_problem(plain_form(parse_toml(text))) for text in (old, new))
    known = {(p.location, str(p.said)) for p in before}
    for problem in after:
        if (problem.location, str(problem.said)) not in known:
            heading = table_name(problem.location)
            raise ExperimentError.of_part(f"[{heading}] " if heading else "", problem.said)


def _assumed_scale(text: str, place: Place) -> Place | None:
    """Where a value says of a gain in it that it is assumed."""
    for item in toml_items(text):
        inside = numbered(item.place)[: len(place)] == place
        if inside and item.place[-1] == "scale" and "assumed" in text[item.value : item.stop]:
            return item.place
    return None


def _removed(text: str, place: Place) -> str:
    """The text without what is at a place."""
    items = checked_items(text)
    item = find_item(text, items, place)
    if item is None:
        heads = [x for x in items if is_head(x) and is_below(x.place, place)]
        if not heads:
            raise ExperimentError(f"{called(place)} is not in the file", advice="reload the page")
        made = _without_tables(text, items, place)
    elif item.inline:
        made = _without_inline(text, items, item)
    else:
        made = _suggested(text, items, item)
    content = content_without(plain_form(parse_toml(text)), place)
    try:
        return _verified([made], content, place)
    except ExperimentError:  # a table that only dotted keys have made is gone with the last one
        return _verified([made], without_empty_tables(content, place[:-1]), place)


def _checked_value(value: str, place: Place) -> str:
    """A value that is one value and nothing else."""
    try:
        content = parse_toml(f"x = {value}")
        if list(content) == ["x"] and toml_items(f"x = {value}")[0].stop == len(value) + 4:
            return value
        reason = "more than one value"
    except ValueError as error:
        reason = str(error)
    raise ExperimentError(
        f"{called(place)}: {_short(value)} is not a value of TOML ({reason})",
        advice="texts stand in "
        'quotation marks, lists in brackets, numbers have a point: "rad", [1.5, 2.0]',
    )


def _verified(made: Sequence[str], wanted: Any, place: Place) -> str:
    """The first text that says what is wanted."""
    for new in made:
        try:
            content = plain_form(parse_toml(new))
        except ValueError:
            continue
        if content == wanted:
            return new
    raise ExperimentError(
        f"{called(place)} cannot be changed here",
        advice="open the file as text and change it there",
    )


def _replaced(text: str, items: Sequence[TomlItem], item: TomlItem, value: str) -> str:
    """Another value, and a comment that says so above its line."""
    line = _line_of(items, item)
    key = _relative(item.place, line.place)
    old = _short(text[item.value : item.stop])
    changed = text[line.start : item.value] + value + text[item.stop : line.stop]
    return _commented(text, line, key, old, changed)


def _commented(text: str, line: TomlItem, key: str, old: str, changed: str) -> str:
    """A changed line with its comment: a reason of `pivident init` becomes a part of it.

    Other comments stay; what stood there before the first change by hand is said, not every step.
    ``key``: what has changed within the value, empty for the whole.
    """
    above = _comment_above(text, line)
    start = line_start(text, line.start)
    words = f"{BY_HAND}{key}: {old}" if key else f"{BY_HAND}{old}"
    said_already = f"{BY_HAND}{key}: " in above.text if key else BY_HAND in above.text
    is_reason = above.text.startswith(tuple(f"{word}: " for word in SURE.values()))
    kept, written = text[above.start : start], ""
    if is_reason and not key:
        kept, written = "", f"{words} ({above.text.rstrip('.')})."
    elif not said_already:
        written = f"{words}."
    lines = comment_lines(written, text) if written else ""
    indent = text[start : line.start]
    return text[: above.start] + kept + lines + indent + changed + text[line.stop :]


def _line_of(items: Sequence[TomlItem], item: TomlItem) -> TomlItem:
    """The key on a line of its own in whose value an entry stands."""
    return next(x for x in items if not x.inline and x.start <= item.start < x.stop)


def _comment_above(text: str, line: TomlItem) -> Comment:
    """The comment of a key on a line of its own, empty where there is none."""
    return next(c for c in comments(text) if c.place == line.place and c.example is None)


def _suggested(text: str, items: Sequence[TomlItem], item: TomlItem) -> str:
    """A key as a comment below its reason, so that it can be taken back."""
    above = _comment_above(text, item)
    end = next_line(text, item.stop)
    tail = text[item.stop : end].strip()
    value = " ".join(text[item.value : item.stop].split())
    key = text[item.start : item.value]
    is_line = "\n" not in text[item.value : item.stop] or not re.search(
        r"#|\"\"\"|'''", text[item.value : item.stop]
    )
    reason = f" Before: {above.text.rstrip('.')}." if above.text else ""
    words = comment_lines(f"{REMOVED}{reason}", text)
    back = with_ends(f"# {key}{value}{f'  {tail}' if tail else ''}\n", text) if is_line else ""
    return text[: above.start] + words + back + text[end:]


def _without_inline(text: str, items: Sequence[TomlItem], item: TomlItem) -> str:
    """An entry of a value removed with its comma."""
    end, start = item.stop, item.start
    behind = re.compile(r"\s*,[ \t]*").match(text, end)
    if behind is not None:
        return text[:start] + text[behind.end() :]
    before = re.search(r"[ \t]*,\s*$", text[:start])
    return text[: before.start() if before else start] + text[end:]


def _without_tables(text: str, items: Sequence[TomlItem], place: Place) -> str:
    """A table removed with everything below it."""
    kept, at, removing = "", 0, False
    for item in items:
        if not is_head(item):
            continue
        gone = is_below(item.place, place)
        if gone and not removing:
            kept += text[at : line_start(text, item.start)]
        if removing and not gone:
            at = line_start(text, item.start)
        removing = gone
    return kept if removing else kept + text[at:]


def _relative(place: Place, table: Place) -> str:
    """A place inside of a value, in words."""
    return ".".join(str(part) for part in place[len(table) :])


def _short(value: str) -> str:
    """A value on one line, cut where it is long."""
    line = " ".join(value.split())
    return line if len(line) <= MAX_VALUE else f"{line[: MAX_VALUE - 1]}…"
