"""Lines of an experiment file: its keys with the reasons above them, and keys that are suggested.

`pivident init` writes both; whoever writes a file by hand may do the same. A comment belongs to the
key right below it. A commented-out key is a suggestion, and the comment above it its reason.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import tomlkit
from tomlkit.items import Array, Comment, Item

from pivident.foundation.text.repair import Place
from pivident.foundation.text.toml import Body, behind_dots, bodies, is_line, key_text, parse_toml

#: How sure a line is, as its comment says it.
SURE = {"certain": "seen", "likely": "likely", "assumed": "ASSUMED, please check"}

#: Short forms of a file: where the key of a table stands that is written as its value.
SHORT_FORMS: dict[Place, Place] = {
    ("robot", "model"): ("robot",),
    ("controller", "type"): ("controller",),
    ("controller", "reference"): ("reference",),
}

#: Beginnings of the sentences in which `pivident init` says how to correct a line.
CORRECTIONS = (
    "In Hz", "Or ", "Set ", "Times on", "Factors to", "They are under", "Write the", "Known gains",
    "Torque beyond", "A copy of", "The order is", "Name the unit", '"rad", "deg"', "Logged speeds",
)  # fmt: skip

_KEY = re.compile(r"#[ \t]*([A-Za-z0-9_-]+(?:\.[A-Za-z0-9_-]+)*)[ \t]*=[ \t]*(\S.*?)\s*$")
_HEADER = re.compile(r"#[ \t]*\[(\[?)([A-Za-z0-9_.-]+)\]?\][ \t]*$")
_SENTENCE = re.compile(r"(?<=[.?!]) +(?=[A-Z\"{])")


@dataclass(frozen=True)
class FileLine:
    """A key on a line of its own, or one that a comment suggests.

    Attributes:
        place: of the key; the only recording is number 0, but where the value is the list of all.
        reason: the comment above it in one line, empty without one.
        body: the lines of its table.
        start: number of the first line of its comment there.
        number: its own.
        header: number of the comment that has its table, where that is only suggested, too.
        example: of a key that is only suggested, what stands behind its ``=``; None for others.
    """

    place: Place
    reason: str
    body: Body
    start: int
    number: int
    header: int | None = None
    example: str | None = None

    @property
    def value(self) -> Item:
        """Its value, or the comment that suggests it."""
        _, body, number = behind_dots(self.body, self.number)
        return body[number][1]

    @property
    def prefix(self) -> str:
        """What stands in front of its last dot, with the dot; empty without one."""
        parts = behind_dots(self.body, self.number)[0]
        return "".join(f"{key_text(str(part))}." for part in parts[:-1])


def file_lines(document: tomlkit.TOMLDocument) -> Iterator[FileLine]:
    """Keys that stand on lines of their own, and suggested keys, in the order of the text."""
    for table, body in bodies(document):
        place, header, words, start = table, None, list[str](), 0
        for number, (key, item) in enumerate(body):
            line = item.as_string().strip() if isinstance(item, Comment) else ""
            heading, suggested = _HEADER.match(line), _suggested(line)
            if line and heading is None and suggested is None:
                if line.startswith(tuple(f"# {word}: " for word in SURE.values())):
                    words, start = [], number
                words += filter(None, [line.lstrip("#").strip()])
                continue
            reason = " ".join(words)
            if suggested is not None:
                inner = numbered((*place, *suggested[0].split(".")))
                yield FileLine(inner, reason, body, start, number, header, suggested[1])
            elif heading is not None:
                place, header = tuple(heading[2].split(".")), number
            elif is_line(key, item):
                place, header = table, None
                parts, holder, at = behind_dots(body, number)
                inner = (*table, *parts)
                if not (len(inner) == 1 and isinstance(holder[at][1], Array)):
                    inner = numbered(inner)
                yield FileLine(inner, reason, body, start, number)
            words, start = [], number + 1


def numbered(place: Sequence[int | str]) -> Place:
    """A place as the check has it: the only recording is number 0."""
    place = tuple(place)
    if place[:1] == ("recording",) and not isinstance((*place, "")[1], int):
        return ("recording", 0, *place[1:])
    return place


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
