"""Lines of keys in a TOML text, which parsers forget.

The text is known to be TOML. Headers and assignments at the start of a line are found by a scan;
keys of inline tables by their name within the lines of the value.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

_HEADER = re.compile(r"\s*\[(\[?)\s*([^\[\]]+?)\s*\]\]?\s*(?:#.*)?$")
_KEY = re.compile(
    r"\s*((?:[\w-]+|\"[^\"]*\"|'[^']*')(?:\s*\.\s*(?:[\w-]+|\"[^\"]*\"|'[^']*'))*)\s*="
)
_PART = re.compile(r"[\w-]+|\"[^\"]*\"|'[^']*'")

#: Tables and keys, without the numbers of tables that are written once.
Path = tuple[int | str, ...]


class TomlLines:
    """Where the keys of a TOML text stand."""

    def __init__(self, text: str) -> None:
        self._lines = text.splitlines()
        self._found: dict[Path, int] = {}
        self._scan()

    def line(self, place: Sequence[int | str]) -> int | None:
        """Line of a place, or of the nearest table around it, counted from 1; None without one."""
        whole = tuple(place)
        for length in range(len(whole), 0, -1):
            for known in _spellings(whole[:length]):
                if known in self._found:
                    return self._within(known, whole[length:])
        return None

    def _scan(self) -> None:
        table: Path = ()
        counts: dict[Path, int] = {}
        depth = 0
        for number, line in enumerate(self._lines, start=1):
            bare = _without_texts(line)
            if depth > 0:
                depth += _opened(bare)
                continue
            header = _HEADER.match(line)
            if header and not _KEY.match(line):
                table = _numbered(_parts(header[2]), counts)
                if header[1]:
                    counts[table] = counts.get(table, -1) + 1
                    table = (*table, counts[table])
                self._found.setdefault(table, number)
                continue
            key = _KEY.match(line)
            if key:
                self._found.setdefault((*table, *_parts(key[1])), number)
                depth = _opened(bare[bare.find("=") + 1 :])

    def _within(self, known: Path, rest: Sequence[int | str]) -> int:
        """The line on which the rest of a place stands, inside a value of several lines."""
        first = self._found[known]
        words = [part for part in rest if isinstance(part, str)]
        if not words:
            return first
        depth = 0
        for number in range(first, len(self._lines) + 1):
            bare = _without_texts(self._lines[number - 1])
            if re.search(rf"(?<![\w-]){re.escape(words[0])}[\"']?\s*=", bare):
                return number
            depth += _opened(bare.split("=", 1)[-1] if number == first else bare)
            if depth <= 0:
                break
        return first


def _spellings(place: Path) -> list[Path]:
    """A place as written: the number of a table that is written once is left out."""
    found = [place]
    for k, part in enumerate(place):
        if part == 0:
            found.append(place[:k] + place[k + 1 :])
    return found


def _numbered(parts: Path, counts: dict[Path, int]) -> Path:
    """A header below an array of tables belongs to its latest element."""
    for k in range(len(parts) - 1, 0, -1):
        if parts[:k] in counts:
            return (*parts[:k], counts[parts[:k]], *parts[k:])
    return parts


def _parts(dotted: str) -> Path:
    return tuple(part.strip("\"'") for part in _PART.findall(dotted))


def _without_texts(line: str) -> str:
    """The line without quoted texts and comments, which may hold brackets."""
    return re.sub(r"\"(?:[^\"\\]|\\.)*\"|'[^']*'", '""', line).partition("#")[0]


def _opened(text: str) -> int:
    """Brackets that a text opens and does not close."""
    return sum(text.count(c) for c in "[{") - sum(text.count(c) for c in "]}")
