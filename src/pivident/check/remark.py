"""One thing that a check has to say, with the place in the experiment file where it is changed."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any

from pivident.errors import FileFormatError, UnknownColumn
from pivident.text.finding import SEVERITIES, Finding

#: Tables and keys of an experiment file, such as ``("recording", 0, "units", "q")``.
Place = tuple[int | str, ...]

#: Where the findings of an audit are fixed, below the table of their recording.
KEYS: dict[tuple[str, str], Place] = {
    ("timing", "no clock"): ("columns", "t"),
    ("timing", "no stamp"): ("columns", "t"),
    ("timing", "rate"): ("units", "t"),
    ("timing", "drift"): ("rate",),
    ("timing", "gap"): ("part",),
    ("timing", "backward"): ("part",),
    ("timing", "jitter"): ("resample",),
    ("channels", "clipped"): ("saturation",),
    ("channels", "wrapped"): ("columns", "q"),
    ("scale", "reach"): ("units", "q"),
    ("scale", "speed"): ("units", "q"),
    ("scale", "angle unit"): ("units", "q"),
    ("scale", "side"): ("side",),
    ("scale", "gain"): ("units", "tau"),
    ("scale", "assumed"): ("units", "tau"),
    ("order", "order"): ("columns", "tau"),
    ("delay", "late"): ("delay",),
    ("delay", "early"): ("delay",),
    ("delay", "joint late"): ("columns", "tau"),
    ("power", "sign"): ("units", "tau"),
    ("speed", "derivative"): ("columns", "dq_ref"),
}

#: Findings of single kinds that are fixed in the robot's table, by its key.
IN_ROBOT = {("power", "gravity at rest"): "gravity", ("scale", "load"): "model"}

#: Findings that are fixed elsewhere than in the table of their recording.
ELSEWHERE: dict[str, Place] = {"excitation": ("identify", "parameters"), "model": ("robot",)}

#: Tables of recordings.
RECORDINGS = (("recording",), ("validation",), ("payload",), ("gains",))

#: Keys that are also words of every message.
AMBIGUOUS = ("name", "joint", "link", "type")

#: How messages about units begin.
_UNIT_MESSAGES = ("unit ", "a unit ", "gain of ", "factor of ", "per_revolution ", "per_metre ")

_TABLE = re.compile(r"\[{1,2}([a-z][\w.-]*)\]{1,2}(?: (\d+):)?")
_KEY = re.compile(r"\bkey '([\w.-]+)'")
_CHANNEL = re.compile(r"\b(q|tau|q_ref|dq_ref|ddq_ref|q_link|t)\b")


@dataclass(frozen=True)
class Remark(Finding):
    """A finding about an experiment, with its place in the file.

    Attributes:
        place: tables and keys of the experiment file where it is changed.
        line: its line in the file, counted from 1, or None.
        refused: whether an identification would stop at it.
    """

    place: Place = ()
    line: int | None = None
    refused: bool = False

    @property
    def heading(self) -> str:
        """The place as people write it: ``line 7, [recording] units.q``."""
        parts = [str(p) for p in self.place if not isinstance(p, int)]
        number = next((p for p in self.place if isinstance(p, int)), 0)
        named = "" if not parts else f"[{parts[0]}]" + (f" {number + 1}" if number else "")
        if len(parts) > 1:
            named += f" {'.'.join(parts[1:])}"
        return ", ".join(filter(None, ("" if self.line is None else f"line {self.line}", named)))

    @property
    def group(self) -> tuple[object, ...]:
        """As of every finding; what is changed elsewhere is another remark."""
        return *super().group, self.place, self.refused


def of_finding(finding: Finding, table: Place) -> Remark:
    """A finding of an audit as a remark about the experiment file."""
    kind = (finding.topic, finding.kind)
    if kind in IN_ROBOT:
        place: Place = ("robot", IN_ROBOT[kind])
    elif finding.topic in ELSEWHERE:
        place = ELSEWHERE[finding.topic]
    else:
        place = (*table, *KEYS.get(kind, ("files",)))
    return Remark(**vars(finding), place=place)


def of_error(
    error: Exception,
    check: str,
    table: Place = (),
    content: Mapping[str, Any] | None = None,
    kind: str = "refused",
) -> Remark:
    """An error that an identification would end with."""
    text = " ".join(str(error).split())
    sentence, step = split_advice(without_table(text))
    place = place_in(text, table)
    if table[:1] in RECORDINGS and text.startswith(_UNIT_MESSAGES):
        place = (*table, "units", *_channel(text)[1:])
    place = with_key(place, text, content or {})
    if place == table and table[:1] in RECORDINGS and not isinstance(error, FileFormatError):
        place = (*table, *_channel(text))
    if isinstance(error, FileFormatError) and place == table:
        place = (*table, "columns" if isinstance(error, UnknownColumn) else "files")
    return Remark("error", check, kind, sentence, next_step=step, place=place, refused=True)


def without_table(text: str) -> str:
    """A message without the table in front, which its place says."""
    return _TABLE.sub("", text, count=1).lstrip() if _TABLE.match(text) else text


def with_key(place: Place, message: str, content: Mapping[str, Any]) -> Place:
    """A place that is a table with the key of it that a message names."""
    value: Any = content
    for part in place:
        known = isinstance(value, Mapping) and part in value
        known = known or (isinstance(value, list) and isinstance(part, int) and part < len(value))
        if not known:
            return place
        value = value[part]
    if not isinstance(value, Mapping):
        return place
    if "no sample of" in message and "part" in value:
        return (*place, "part")
    if "no data set" in message and "dataset" in value:
        return (*place, "dataset")
    words = re.findall(r"[a-z][a-z_]*", message)
    named = [w for w in words if w in value and w not in AMBIGUOUS]
    return with_key((*place, named[0]), message, content) if named else place


def split_advice(text: str) -> tuple[str, str]:
    """What was seen and what to do, of a message that says both: ``seen; do this``."""
    head, separator, tail = text.partition("; ")
    if not separator:
        return sentence_of(text), ""
    return sentence_of(head), sentence_of(tail)


def sentence_of(text: str) -> str:
    """A half sentence as a sentence: a capital in front unless it is a name, a stop behind."""
    first = text.split(" ", 1)[0]
    plain_word = first.isalpha() and first.islower() and first not in _NAMES
    text = text[:1].upper() + text[1:] if plain_word else text
    return text if text.endswith((".", "?", "!")) else f"{text}."


#: Words of the file that keep their small letter at the start of a sentence.
_NAMES = {"q", "dq", "tau", "t", "kp", "kd", "ki", "kv", "rate", "mask", "delay", "files", "name"}


def place_in(message: str, table: Place = ()) -> Place:
    """Table and key that a message names."""
    found = _TABLE.match(message)
    place: Place = table
    if found:
        named = tuple(found[1].split("."))
        number = (int(found[2]) - 1,) if found[2] else ()
        if not table or table[0] != named[0]:
            place = (*named, *number)
    key = _KEY.search(message)
    return (*place, *key[1].split(".")) if key else place


def _channel(message: str) -> Place:
    """Columns or units of the channel that a message names."""
    channel = _CHANNEL.search(message)
    if channel is None:
        return ()
    is_unit = message.startswith(f"{channel[1]} has") and " units for " in message
    return ("units" if is_unit else "columns", channel[1])


def gravest_first(remarks: Iterable[Remark]) -> list[Remark]:
    """Remarks in order of severity, those that stop an identification first of all."""
    return sorted(remarks, key=lambda r: (-SEVERITIES.index(r.severity), not r.refused))


def with_line(remark: Remark, line: int | None) -> Remark:
    """The remark with its line."""
    return replace(remark, line=line)
