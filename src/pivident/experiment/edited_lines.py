"""Lines of an experiment file changed, added and removed, each with a comment that says so.

Nothing is verified here: `pivident.experiment.edited_file` compares what is said before and after.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from typing import Any

import tomlkit
from tomlkit.items import AoT, Array, InlineTable, Item, String, Table

from pivident.experiment.explained import plain_form
from pivident.experiment.file_lines import SHORT_FORMS, SURE, FileLine, file_lines, numbered
from pivident.foundation.errors import ExperimentError
from pivident.foundation.text.repair import Place
from pivident.foundation.text.toml import (
    Body,
    behind_dots,
    bodies,
    comment,
    is_line,
    key_text,
    keys_in,
    parse_toml,
    parts_of,
    toml_document,
)

#: Longest old value that its comment repeats, in characters.
MAX_VALUE = 200

#: What the comment of a line says that somebody has set.
BY_HAND = "Set by hand. Before: "

#: What the comment of a key says that somebody has removed, which is then only suggested.
REMOVED = "Removed by hand."


def content_of(text: str) -> dict[str, Any]:
    """What a text says, its short forms written out.

    Raises:
        ExperimentError: it is not TOML.
    """
    try:
        return plain_form(parse_toml(text))
    except ValueError as error:
        raise ExperimentError(f"is not TOML: {error}", advice="correct this line") from error


def document_of(text: str, *, to_write: bool = True) -> tomlkit.TOMLDocument:
    """The text of an experiment file with its comments, ready to be changed or only to be read.

    Raises:
        ExperimentError: it is not TOML, or is to be written and in an order that cannot be kept.
    """
    content_of(text)
    try:
        return toml_document(text, to_write=to_write)
    except ValueError as error:
        raise ExperimentError(
            f"cannot be changed here: {error}", advice="open the file as text and change it there"
        ) from error


def line_at(document: tomlkit.TOMLDocument, place: Place) -> tuple[FileLine, Place] | None:
    """The line in which a value stands, which may be written in short, and where inside of it."""
    for line in file_lines(document):
        rest = place[len(line.place) :]
        if line.example is not None:
            continue
        if (*line.place, *rest) == place and _inside(line.value, rest) is not None:
            return line, rest
        if line.place == SHORT_FORMS.get(place) and isinstance(line.value, String):
            return line, ()
    return None


def _inside(item: Any, rest: Place) -> Item | None:
    """What stands inside of a value."""
    for part in rest:
        try:
            item = item.item(part)
        except (AttributeError, LookupError, TypeError):
            return None
    return item


def with_value(text: str, place: Place, value: str) -> str | None:
    """The text with another value, and a comment that says so; None where there is no such key.

    A reason of `pivident init` becomes a part of it, other comments stay; what stood there before
    the first change by hand is said, not every step.
    """
    document = document_of(text)
    spot = line_at(document, place)
    if spot is None:
        return None
    line, rest = spot
    old = _put(line, rest, tomlkit.value(value))
    if old == value:
        return text
    key = f"{'.'.join(map(str, rest))}: " if rest else ""
    words = f"{BY_HAND}{key}{short(old)}"
    if not rest and line.reason.startswith(tuple(f"{word}: " for word in SURE.values())):
        words = f"{words} ({line.reason.rstrip('.')})."
        line.body[line.start : line.number] = comment_lines(words, text)
    elif f"{BY_HAND}{key}" not in line.reason:
        line.body[line.number : line.number] = comment_lines(f"{words}.", text)
    return document.as_string()


def _put(line: FileLine, rest: Place, value: Item) -> str:
    """Another value at a place inside of a line's, with all that stands around it; the old one."""
    _, body, number = behind_dots(line.body, line.number)
    key, old = body[number]
    if rest:
        around: Any = _inside(old, rest[:-1])
        old = around.item(rest[-1])
        holder: Any = around if isinstance(around, Array) else around.value
        holder[rest[-1]] = value
    else:
        vars(value.trivia).update(vars(old.trivia))
        body[number] = (key, value)
    return old.as_string()


def _braces(around: InlineTable | Table, left_out: Place = (), more: Sequence[str] = ()) -> Item:
    """A table in braces without a key, or with more pairs."""
    kept = [
        f"{'.'.join(key_text(str(part)) for part in parts)} = {item.as_string()}"
        for parts, _, item in keys_in(around)
        if parts != left_out
    ]
    return tomlkit.value(f"{{{', '.join([*kept, *more])}}}")


def without(text: str, place: Place) -> str:
    """The text without what is at a place; a line stays as a suggestion, so that it can be back."""
    document = document_of(text)
    spot = line_at(document, place)
    if spot is None:
        return without_tables(document, place)
    line, rest = spot
    if rest:
        around: Any = _inside(line.value, rest[:-1])
        if isinstance(around, Array):
            del around[int(rest[-1])]
        else:
            _put(line, rest[:-1], _braces(around, rest[-1:]))
        return document.as_string()
    value, suggestion = line.value.as_string(), ""
    reason = f" Before: {line.reason.rstrip('.')}." if line.reason else ""
    if "\n" not in value or not re.search(r"#|\"\"\"|'''", value):
        alone = tomlkit.document()
        alone.body.append(line.body[line.number])
        written = alone.as_string().strip().replace(value, " ".join(value.split()), 1)
        suggestion = f"# {written}\n"
    line.body[line.start : line.number + 1] = comment_lines(f"{REMOVED}{reason}", text, suggestion)
    return document.as_string()


def without_tables(document: tomlkit.TOMLDocument, place: Place) -> str:
    """The text without all tables and dotted keys at or below a place."""

    def is_below(at: Place) -> bool:
        return numbered(at)[: len(place)] == place

    for table, body in list(bodies(document)):
        for number, (key, item) in reversed(list(enumerate(body))):
            parts = behind_dots(body, number)[0] if is_line(key, item) else parts_of(key)
            inner = (*table, *parts)
            gone = key is not None and is_below(inner)
            if isinstance(item, AoT):
                item.body[:] = [x for k, x in enumerate(item.body) if not is_below((*inner, k))]
                gone = not item.body
            if gone:
                del body[number]
    return document.as_string()


def ways_to_add(text: str, place: Place, value: str, before: str) -> Iterator[str]:
    """Ways to write a key that is not there, the most natural first."""
    *table, key = place
    if not isinstance(key, str):
        return
    if text and not text.endswith("\n"):
        text += with_ends("\n", text)
    pair = f"{key_text(key)} = {value}"
    yield from _accepted(text, place, pair)
    yield from _in_table(text, tuple(table), pair, before)
    if len(table) > 1 and isinstance(table[-1], str):
        inline = f"{key_text(table[-1])} = {{{pair}}}"
        yield from _in_table(text, tuple(table[:-1]), inline, before)
    if table and all(isinstance(part, str) for part in table):
        heading = ".".join(key_text(str(part)) for part in table)
        yield text + with_ends(f"\n[{heading}]\n{pair}\n", text)


def _accepted(text: str, place: Place, pair: str) -> Iterator[str]:
    """A suggested key in place of its comment, with its table where that is a comment too."""
    document = document_of(text)
    line = next((x for x in file_lines(document) if x.place == place and x.example), None)
    if line is None:
        return
    reason = f" ({line.reason.rstrip('.')})" if line.reason else ""
    if line.header is not None:
        header = line.body[line.header][1].trivia
        header.comment = header.comment.lstrip("# \t")
    line.body[line.start : line.number + 1] = _line(pair, f"not set{reason}", text)
    yield document.as_string()


def _in_table(text: str, table: Place, pair: str, before: str) -> Iterator[str]:
    """A key inside of a table that is there, in whichever form."""
    document = document_of(text)
    spot = line_at(document, table)
    if spot is not None:
        line, rest = spot
        around: Any = _inside(line.value, rest)
        for whole, short_form in SHORT_FORMS.items():
            if short_form == line.place and isinstance(around, String):
                around = tomlkit.value(f"{{{whole[1]} = {around.as_string()}}}")
        if isinstance(around, InlineTable):
            _put(line, rest, _braces(around, more=[pair]))
        yield document.as_string()
        return
    ends = [
        (line.body, line.number + 1, line.prefix)
        for line in file_lines(document)
        if line.prefix and numbered(line.place[:-1]) == table
    ]
    for place, body in bodies(document):
        if numbered(place) == table and not ends:
            lines = [k for k, (key, item) in enumerate(body) if is_line(key, item)]
            ends = [(body, max(lines, default=-1) + 1, "")]
    for body, number, prefix in ends[-1:]:
        body[number:number] = _line(f"{prefix}{pair}", before, text)
        yield document.as_string()


def _line(pair: str, before: str, text: str) -> Body:
    """One more line, with a comment that says who has set it."""
    return comment_lines(f"{BY_HAND}{before}.", text, f"{pair}\n")


def comment_lines(words: str, text: str, behind: str = "") -> Body:
    """Words as lines of a comment, with other lines behind them."""
    return tomlkit.parse(with_ends(f"{comment(words)}\n{behind}", text)).body


def with_ends(lines: str, text: str) -> str:
    """Lines with the line ends of a text."""
    lines = lines.replace("\r\n", "\n")
    return lines.replace("\n", "\r\n") if "\r\n" in text else lines


def table_name(place: Sequence[int | str]) -> str:
    """Tables of a place without their numbers."""
    return ".".join(str(part) for part in place[:-1] if isinstance(part, str))


def called(place: Place) -> str:
    """A place in words: its table and key."""
    heading = table_name(place)
    return f"[{heading}] {place[-1]}" if heading else str(place[-1])


def short(value: str) -> str:
    """A value on one line, cut where it is long."""
    line = " ".join(value.split())
    return line if len(line) <= MAX_VALUE else f"{line[: MAX_VALUE - 1]}…"
