"""A TOML text with its comments, its order and its format, as `tomlkit` reads it.

A table of `tomlkit` is a list of lines, its *body*: keys with their values, comments, blank lines.
Lines that are changed, added or removed there are all that changes in the text.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import tomlkit
from tomlkit.exceptions import TOMLKitError
from tomlkit.items import AoT, InlineTable, Item, Key, Table

from pivident.foundation.text.repair import Place
from pivident.foundation.text.toml import parse_toml

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
