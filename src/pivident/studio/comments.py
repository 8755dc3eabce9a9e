"""Comments of an experiment file: reasons above its keys, and keys that are only suggested.

`pivident init` writes both; whoever writes a file by hand may do the same. A comment belongs to the
key right below it. A commented-out key is a suggestion, and the comment above it its reason.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass

from pivident.init.assumption import SURE
from pivident.text.toml import parse_toml
from pivident.text.toml_places import Place, toml_items

#: What the comment of a line says that somebody has set.
BY_HAND = "Set by hand. Before: "

#: Beginnings of the sentences in which `pivident init` says how to correct a line.
CORRECTIONS = (
    "In Hz", "Or ", "Set ", "Times on", "Factors to", "They are under", "Write the", "Known gains",
    "Torque beyond", "A copy of", "The order is", "Name the unit", '"rad", "deg"', "Logged speeds",
)  # fmt: skip

_KEY = re.compile(r"#[ \t]*([A-Za-z0-9_-]+(?:\.[A-Za-z0-9_-]+)*)[ \t]*=[ \t]*(\S.*?)\s*$")
_HEADER = re.compile(r"#[ \t]*\[(\[?)([A-Za-z0-9_.-]+)\]?\][ \t]*$")
_SENTENCE = re.compile(r"(?<=[.?!]) +(?=[A-Z\"{])")


@dataclass(frozen=True)
class Comment:
    """What is commented above a key.

    Attributes:
        place: of the key, which may be only suggested.
        text: the comment in one line, empty without one.
        start: where its first line begins.
        stop: where the line below its last begins.
        example: of a key that is only suggested, what stands behind its ``=``; None for others.
    """

    place: Place
    text: str
    start: int
    stop: int
    example: str | None = None


def comments(text: str) -> list[Comment]:
    """The comments of keys that stand on lines of their own, and the suggested keys."""
    found, end, table = [], 0, Place()
    items = [item for item in toml_items(text) if not item.inline]
    for item in items:
        suggested, above = _read(text, end, line_start(text, item.start), table)
        found += suggested
        if item.kind == "key":
            found.append(Comment(item.place, *above))
        else:
            table = item.place
        end = item.stop
    found += _read(text, end, len(text), table)[0]
    return found


def sureness(comment: str) -> tuple[str, str, str]:
    """How sure a line is, the reason, and how to correct it, of the comment above it."""
    for sure, word in SURE.items():
        if comment.startswith(f"{word}: "):
            reason, correct = _parts(comment.removeprefix(f"{word}: "))
            return sure, reason, correct
    return "given", comment, ""


def _parts(text: str) -> tuple[str, str]:
    """The reason and the sentences on how to correct the line."""
    sentences = _SENTENCE.split(text)
    for k, sentence in enumerate(sentences):
        if k and sentence.startswith(CORRECTIONS):
            return " ".join(sentences[:k]), " ".join(sentences[k:])
    return text, ""


def _read(
    text: str, start: int, stop: int, table: Place
) -> tuple[list[Comment], tuple[str, int, int]]:
    """Suggested keys between two items, and the comment that ends where the next begins."""
    found: list[Comment] = []
    words: list[str] = []
    first = at = next_line(text, start)
    for line in _lines(text, first, stop):
        bare = line.strip()
        header, key = _HEADER.match(bare), _suggested(bare)
        if not bare.startswith("#") or header:
            table = tuple(header[2].split(".")) if header else table
            words, first = [], at + len(line)
        elif key is not None:
            place = (*table, *key[0].split("."))
            found.append(Comment(place, " ".join(words), first, at + len(line), key[1]))
            words, first = [], at + len(line)
        else:
            if any(bare.startswith(f"# {word}: ") for word in SURE.values()):
                words, first = [], at
            words += [w for w in [bare.lstrip("#").strip()] if w]
        at += len(line)
    return found, (" ".join(words), first, at)


def _suggested(line: str) -> tuple[str, str] | None:
    """Key and value of a line that is TOML but for its ``#``."""
    found = _KEY.match(line)
    if found is None:
        return None
    try:
        parse_toml(f"{found[1]} = {found[2]}")
    except ValueError:
        return None
    return found[1], found[2]


def _lines(text: str, start: int, stop: int) -> Iterator[str]:
    yield from re.findall(r"[^\n]*\n|[^\n]+", text[start:stop])


def line_start(text: str, at: int) -> int:
    """Where the line of a character begins."""
    return text.rfind("\n", 0, at) + 1


def next_line(text: str, at: int) -> int:
    """Where the line behind that of a character begins; a line that begins here is the next."""
    if at == 0 or text[at - 1 : at] == "\n":
        return at
    end = text.find("\n", at)
    return len(text) if end < 0 else end + 1
