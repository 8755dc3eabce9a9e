"""The content of an experiment file as plain values, with one of them changed, or keys added."""

from __future__ import annotations

import copy
import re
from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import Any

from pivident.errors import ExperimentError
from pivident.experiment.explained import plain_form
from pivident.init.assumption import comment
from pivident.studio.comments import BY_HAND, Comment, comments, next_line
from pivident.studio.key_words import SHORT_FORMS, numbered
from pivident.studio.rows import table_name
from pivident.text.toml_places import Place, TomlItem, spellings
from pivident.text.toml_values import key_text


def content_with(content: dict[str, Any], place: Place, value: Any) -> dict[str, Any]:
    """The content with a value at a place."""
    new = copy.deepcopy(content)
    table: Any = new
    for part, after in pairwise(place):
        if isinstance(table, dict) and part not in table:
            table[part] = {} if isinstance(after, str) else []
        table = _inside(table, part, place)
    if isinstance(table, list) and not (isinstance(place[-1], int) and place[-1] < len(table)):
        raise ExperimentError(f"{called(place)} is not in the file", advice="reload the page")
    table[place[-1]] = value
    return plain_form(new)


def content_without(content: dict[str, Any], place: Place) -> dict[str, Any]:
    """The content without what is at a place."""
    new = copy.deepcopy(content)
    table: Any = new
    for part in place[:-1]:
        table = _inside(table, part, place)
    del table[place[-1]]
    if isinstance(table, list) and not table:
        return content_without(content, place[:-1])
    return plain_form(new)


def without_empty_tables(content: Any, place: Place) -> Any:
    """The content without a table that is empty, nor those around it that are empty then."""
    inner = content
    for part in place:
        inner = _inside(inner, part, place)
    if inner or not place:
        return content
    return without_empty_tables(content_without(content, place), place[:-1])


def _inside(table: Any, part: int | str, place: Place) -> Any:
    """A part of a table."""
    try:
        inner = table[part]
    except (KeyError, IndexError, TypeError):
        inner = None
    if not isinstance(inner, (dict, list)):
        raise ExperimentError(
            f"{called(place)} has no table to stand in", advice="add the table as text"
        )
    return inner


def called(place: Place) -> str:
    """A place in words: its table and key."""
    heading = table_name(place)
    return f"[{heading}] {place[-1]}" if heading else str(place[-1])


def find_item(text: str, items: Sequence[TomlItem], place: Place) -> TomlItem | None:
    """The key or entry at a place, which may be written in short."""
    known = {item.place: item for item in items if not is_head(item)}
    for spelling in spellings(place):
        if spelling in known:
            return known[spelling]
    short = known.get(SHORT_FORMS.get(place, ()))
    return short if short is not None and text[short.value] in "\"'" else None


def is_head(item: TomlItem) -> bool:
    """Whether it is the header of a table."""
    return item.kind in ("table", "element")


def is_below(place: Place, table: Place) -> bool:
    """Whether a place is a table's, or inside of it."""
    return numbered(place)[: len(table)] == table


def added_ways(text: str, items: Sequence[TomlItem], place: Place, value: str) -> Iterator[str]:
    """Ways to write a key that is not there, the most natural first."""
    *table, key = place
    if not isinstance(key, str):
        return
    for suggested in comments(text):
        if suggested.example is not None and numbered(suggested.place) == place:
            yield from _accepted(text, items, suggested, f"{key_text(key)} = {value}")
    yield from _in_table(text, items, tuple(table), key, value)
    if len(table) > 1 and isinstance(table[-1], str):
        inline = f"{{{key_text(key)} = {value}}}"
        yield from _in_table(text, items, tuple(table[:-1]), table[-1], inline)
    if table and all(isinstance(part, str) for part in table):
        end = "" if not text or text.endswith("\n") else "\n"
        heading = ".".join(key_text(str(part)) for part in table)
        lines = f"{end}\n[{heading}]\n{key_text(key)} = {value}\n"
        yield text + with_ends(lines, text)


def _accepted(text: str, items: Sequence[TomlItem], suggested: Comment, line: str) -> Iterator[str]:
    """A suggested key in place of its comment, with its table where that is a comment too."""
    reason = f" ({suggested.text.rstrip('.')})" if suggested.text else ""
    written = comment_lines(f"{BY_HAND}not set{reason}.", text) + with_ends(f"{line}\n", text)
    head, rest = text[: suggested.start], text[suggested.stop :]
    yield head + written + rest
    name = re.escape(".".join(str(part) for part in suggested.place[:-1]))
    headers = list(re.finditer(rf"^#[ \t]*(\[{name}\])", head, re.MULTILINE))
    if headers:
        last = headers[-1]
        yield head[: last.start()] + last[1] + head[last.end() :] + written + rest


def _in_table(
    text: str, items: Sequence[TomlItem], table: Place, key: str, value: str
) -> Iterator[str]:
    """A key inside of a table that is there, in whichever form."""
    pair = f"{key_text(key)} = {value}"
    around = find_item(text, items, table) if table else None
    if around is not None and text[around.value] == "{":
        inside = [x for x in items if x.inline and around.value < x.start < around.stop]
        at = max((x.stop for x in inside), default=around.value + 1)
        yield text[:at] + (f", {pair}" if inside else pair) + text[at:]
    elif around is not None and table in {(whole[0],) for whole in SHORT_FORMS}:
        main = next(whole[1] for whole, short in SHORT_FORMS.items() if short == table)
        old = text[around.value : around.stop]
        yield text[: around.value] + f"{{{main} = {old}, {pair}}}" + text[around.stop :]
    for k, head in enumerate(items):
        if is_head(head) and table in spelt(head.place):
            own = [head]
            for item in items[k + 1 :]:
                if is_head(item):
                    break
                own.append(item)
            yield _new_line(text, max(item.stop for item in own), pair)
    below = [x for x in items if not x.inline and not is_head(x) and is_below(x.place, table)]
    for item in reversed(below if table else []):
        whole = text[item.start : item.value].partition("=")[0].strip()
        prefix = whole.rpartition(".")[0]
        if prefix and numbered(item.place[:-1]) == table:
            yield _new_line(text, item.stop, f"{prefix}.{pair}")
    if not table:
        first = next((x.start for x in items if is_head(x)), len(text))
        ends = [x.stop for x in items if x.stop < first and not x.inline]
        yield _new_line(text, max(ends), pair) if ends else with_ends(f"{pair}\n", text) + text


def spelt(place: Place) -> set[Place]:
    """A place of the text and the same with the number of the only recording."""
    return {place, numbered(place), numbered((*place, ""))[:-1]}


def _new_line(text: str, at: int, line: str) -> str:
    """One more line behind that of a character, with a comment that says who has set it."""
    end = next_line(text, at) if at else 0
    start = "" if end == 0 or text[end - 1] == "\n" else "\n"
    words = comment_lines(f"{BY_HAND}not set.", text)
    return text[:end] + with_ends(start, text) + words + with_ends(f"{line}\n", text) + text[end:]


def comment_lines(words: str, text: str) -> str:
    """Words as lines of a comment."""
    return with_ends(comment(words) + "\n", text)


def with_ends(lines: str, text: str) -> str:
    """Lines with the line ends of a text."""
    first = text.find("\n")
    lines = lines.replace("\r\n", "\n")
    return lines.replace("\n", "\r\n") if first > 0 and text[first - 1] == "\r" else lines
