"""Where the tables, keys and values of a TOML text stand, which parsers forget.

The text is known to be TOML. It is read once from the beginning to the end; what a value is, is
left to the parser.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Literal

from pivident.text.repair import Place

_BLANK = re.compile(r"(?:[ \t\r\n]|#[^\n]*)*")
_SPACE = re.compile(r"[ \t]*")
_PART = re.compile(r"[A-Za-z0-9_-]+|\"(?:[^\"\\\n]|\\.)*\"|'[^'\n]*'")
_TEXT = re.compile(
    r"\"\"\"(?:[^\\]|\\.)*?\"\"\"\"{0,2}|'''.*?''''{0,2}|\"(?:[^\"\\\n]|\\.)*\"|'[^'\n]*'",
    re.DOTALL,
)
_PLAIN = re.compile(r"[^,\]}#\r\n]*")


@dataclass(frozen=True)
class TomlItem:
    """A header, a key with its value, or an element of a list.

    Attributes:
        place: where it is; the number of a table that is written once is left out.
        kind: ``table`` for ``[a]``, ``element`` for ``[[a]]``, ``key``, or ``entry`` of a list.
        start: first character of header, key or entry.
        value: first character of the value; of a header what follows it.
        stop: first character behind the value, or behind the header.
        inline: whether it stands inside of a value.
    """

    place: Place
    kind: Literal["table", "element", "key", "entry"]
    start: int
    value: int
    stop: int
    inline: bool = False


def toml_items(text: str) -> list[TomlItem]:
    """Everything that stands in a TOML text, in the order of the text; around before inside."""
    return list(_Scan(text).items())


def spellings(place: Sequence[int | str]) -> Iterator[Place]:
    """A place as it may be written: zeros, of tables that are written once, left out or not."""
    if not place:
        yield ()
        return
    for rest in spellings(place[1:]):
        yield (place[0], *rest)
        if place[0] == 0:
            yield rest


class _Scan:
    """One pass over a text."""

    def __init__(self, text: str) -> None:
        self.text = text
        self.at = 0
        self.counts: dict[Place, int] = {}

    def items(self) -> Iterator[TomlItem]:
        """Headers and keys, with what is inside of their values."""
        table: Place = ()
        while self._skip(_BLANK) < len(self.text):
            start = self.at
            if self.text[start] != "[":
                yield from self._pair(table, inline=False)
                continue
            several = self.text.startswith("[[", start)
            self.at += 2 if several else 1
            table = self._numbered(self._key(), several)
            self.at = self.text.index("]", self.at) + (2 if several else 1)
            yield TomlItem(table, "element" if several else "table", start, self.at, self.at)

    def _skip(self, pattern: re.Pattern[str]) -> int:
        """Go on behind a pattern."""
        found = pattern.match(self.text, self.at)
        self.at = self.at if found is None else found.end()
        return self.at

    def _key(self) -> list[str]:
        """The parts of a dotted key, up to what follows it."""
        parts = []
        while True:
            self._skip(_SPACE)
            start = self.at
            part = self.text[start : self._skip(_PART)]
            parts.append(next(iter(tomllib.loads(f"{part}=0"))) if part[:1] in "\"'" else part)
            self._skip(_SPACE)
            if self.text[self.at : self.at + 1] != ".":
                return parts
            self.at += 1

    def _numbered(self, parts: Sequence[str], several: bool) -> Place:
        """A header below a list of tables belongs to its latest element."""
        place: Place = ()
        for k, part in enumerate(parts):
            place = (*place, part)
            if several and k == len(parts) - 1:
                self.counts[place] = self.counts.get(place, -1) + 1
            if place in self.counts:
                place = (*place, self.counts[place])
        return place

    def _pair(self, table: Place, *, inline: bool) -> Iterator[TomlItem]:
        """A key with its value."""
        start = self.at
        place = (*table, *self._key())
        self.at = self.text.index("=", self.at) + 1
        self._skip(_SPACE)
        yield from self._value(place, "key", start, inline=inline)

    def _value(
        self, place: Place, kind: Literal["key", "entry"], start: int, *, inline: bool
    ) -> Iterator[TomlItem]:
        """A value, and then what is inside of it."""
        value, inside = self.at, list[TomlItem]()
        first = self.text[value : value + 1]
        if first in ("[", "{"):
            inside = list(self._inside(place, "]" if first == "[" else "}"))
        elif first in ('"', "'"):
            self._skip(_TEXT)
        else:
            plain = self.text[value : self._skip(_PLAIN)]
            self.at = value + len(plain.rstrip())
        yield TomlItem(place, kind, start, value, self.at, inline)
        yield from inside

    def _inside(self, place: Place, end: str) -> Iterator[TomlItem]:
        """Entries of a list, or pairs of a table in braces."""
        self.at += 1
        number = 0
        while self.text[self._skip(_BLANK)] != end:
            if self.text[self.at] == ",":
                self.at += 1
            elif end == "}":
                yield from self._pair(place, inline=True)
            else:
                yield from self._value((*place, number), "entry", self.at, inline=True)
                number += 1
        self.at += 1
