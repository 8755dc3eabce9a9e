"""TOML from untrusted files: results and errors in bounded time.

The standard parser takes time quadratic in the parts of a key, and follows nested values by
recursion; both are bounded here.

Keys, values and comments as TOML, laid out for people who edit them.

A TOML text with its comments, its order and its format, as `tomlkit` reads it.

A table of `tomlkit` is a list of lines, its *body*: keys with their values, comments, blank lines.
Lines that are changed, added or removed there are all that changes in the text.
"""

from __future__ import annotations

import json
import math
import re
import textwrap
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from datetime import date, time
from typing import Any

import tomlkit
from tomlkit.exceptions import TOMLKitError
from tomlkit.items import AoT, InlineTable, Item, Key, Table

from pivident.foundation.text.identifiers import escaped
from pivident.foundation.text.repair import Place

#: Maximum number of parts of a dotted key. No key here has more than seven.
MAX_PARTS = 12

_PART = r"(?:[\w-]++|\"(?:[^\"\\\n]|\\.)*+\"|'[^'\n]*+')"
_LONG_KEY = re.compile(rf"(?<![\w.\"'-])(?:{_PART}[ \t]*+\.[ \t]*+){{{MAX_PARTS}}}")


def parse_toml(text: str) -> dict[str, Any]:
    """The tables of a TOML text."""
    long_key = _LONG_KEY.search(text)
    if long_key is not None:
        line = text.count("\n", 0, long_key.start()) + 1
        raise ValueError(f"a key has more than {MAX_PARTS} parts (at line {line})")
    try:
        tables = tomllib.loads(text.removeprefix("\ufeff"))
    except RecursionError:
        raise ValueError("its values are nested too deeply") from None
    except tomllib.TOMLDecodeError:
        raise
    except ValueError as error:  # a whole number of thousands of digits
        raise ValueError(str(error).partition(";")[0]) from None
    _check_whole_numbers(tables)
    return tables


def toml_lines(tables: Mapping[str, Any], heading: str = "") -> list[str]:
    """Tables as TOML, one dotted key to a line; keys of None are left out."""
    lines = []
    for key, value in tables.items():
        name = f"{heading}.{key}" if heading else key
        if isinstance(value, Mapping) and value:
            lines += toml_lines(value, name)
        elif value is not None:
            lines.append(f"{name} = {toml_value(value)}")
    return lines


def toml_value(value: Any) -> str:
    """One value on one line; keys of None are left out."""
    if isinstance(value, Mapping):
        pairs = (f"{key} = {toml_value(x)}" for key, x in value.items() if x is not None)
        return "{" + ", ".join(pairs) + "}"
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(map(toml_value, value)) + "]"
    if isinstance(value, float) and not math.isfinite(value):
        return str(value)
    return json.dumps(value, ensure_ascii=False, default=str)


def _check_whole_numbers(value: Any, key: str = "") -> None:
    """Refuse whole numbers beyond 64 bits, which the parser accepts."""
    if isinstance(value, dict):
        for name, inner in value.items():
            _check_whole_numbers(inner, name)
    elif isinstance(value, list):
        for inner in value:
            _check_whole_numbers(inner, key)
    elif isinstance(value, int) and not -(2**63) <= value < 2**63:
        raise ValueError(f"key {key!r} is a whole number beyond the 64 bits that TOML has for it")


#: Width from which on a list takes a line for each entry, in characters.
WIDTH = 98

_BARE_KEY = re.compile(r"[A-Za-z0-9_-]+")


def key_text(key: str) -> str:
    """A key of TOML, quoted where it has to be."""
    return key if _BARE_KEY.fullmatch(key) else string_text(key)


def string_text(text: str) -> str:
    """A string of TOML in quotation marks."""
    out = []
    for character in text:
        code = ord(character)
        if character in '"\\':
            out.append(f"\\{character}")
        elif code < 0x20 or 0x7F <= code < 0xA0 or code in (0x2028, 0x2029):
            out.append(f"\\u{code:04X}")
        else:
            out.append(character)
    return f'"{"".join(out)}"'


def value_text(value: Any, width: int = WIDTH) -> str:
    """A value of TOML; long lists take a line for each entry."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return string_text(value)
    if isinstance(value, (int, float)):
        return repr(value)
    if isinstance(value, dict):  # TOML 1.0 keeps an inline table on one line
        return (
            "{"
            + ", ".join(f"{key_text(k)} = {value_text(v, 10**9)}" for k, v in value.items())
            + "}"
        )
    if isinstance(value, (date, time)):
        return value.isoformat()
    entries = [value_text(entry, 10**9) for entry in value]
    line = "[" + ", ".join(entries) + "]"
    if len(line) <= width:
        return line
    return "[\n" + "".join(f"    {entry},\n" for entry in entries) + "]"


def comment(text: str) -> str:
    """Text as comment lines that nothing in it can break out of."""
    clean = escaped(text.replace("\n", " ").replace("\r", " ").replace("\t", " "))
    clean = clean.encode("utf-8", "backslashreplace").decode()
    if text.startswith("    ") or not clean:
        return f"# {clean}".rstrip()
    lines = textwrap.wrap(clean, WIDTH, break_long_words=False, break_on_hyphens=False)
    return "\n".join(f"# {line}" for line in lines)


#: The lines of a table: key and value; comments and blank lines have no key.
Body = list[tuple[Key | None, Item]]


def toml_document(text: str, *, to_write: bool) -> tomlkit.TOMLDocument:
    """A text with its comments and its order.

    Args:
        text: the text.
        to_write: whether the text is to be the same when it is written again.

    Raises:
        ValueError: it is not TOML, or `tomlkit` would write it in another order.
    """
    parse_toml(text)
    try:
        document = tomlkit.parse(text)
    except (TOMLKitError, RecursionError) as error:
        raise ValueError(str(error)) from None
    if to_write and document.as_string() != text:
        raise ValueError("the tables of a list have others between them")
    return document


def tables(body: Body, place: Place = ()) -> Iterator[tuple[Place, Table]]:
    """Tables below a body, those that others only pass through included, in the text's order."""
    for key, item in body:
        inner = (*place, *parts_of(key))
        below: Sequence[tuple[Place, Table]] = ()
        if isinstance(item, AoT):
            below = [((*inner, number), element) for number, element in enumerate(item.body)]
        elif isinstance(item, Table) and not is_line(key, item):
            below = [(inner, item)]
        for at, table in below:
            yield at, table
            yield from tables(table.value.body, at)


def bodies(document: tomlkit.TOMLDocument) -> Iterator[tuple[Place, Body]]:
    """The lines that stand above all headers, and those below each, in the order of the text."""
    yield (), document.body
    for place, table in tables(document.body):
        yield place, table.value.body


def is_line(key: Key | None, item: Item) -> bool:
    """Whether a part of a body is a key on a line of its own."""
    return key is not None and (key.is_dotted() or not isinstance(item, (Table, AoT)))


def behind_dots(body: Body, number: int) -> tuple[Place, Body, int]:
    """Of a line, the parts of its key, and where `tomlkit` keeps its value."""
    key, item = body[number]
    place = parts_of(key)
    while isinstance(item, Table):
        body, number = item.value.body, 0
        key, item = body[number]
        place = (*place, *parts_of(key))
    return place, body, number


def keys_in(table: InlineTable | Table) -> Iterator[tuple[Place, Key, Item]]:
    """The keys of a table in braces, with the parts of each and its value."""
    for key, item in table.value.body:
        if key is None:
            continue
        if not isinstance(item, Table):
            yield parts_of(key), key, item
            continue
        for parts, inner, value in keys_in(item):  # behind a dot
            yield (*parts_of(key), *parts), inner, value


def parts_of(key: Key | None) -> Place:
    """The parts of a dotted key."""
    return () if key is None else tuple(part.key for part in key)
