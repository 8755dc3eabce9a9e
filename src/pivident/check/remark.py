"""One thing that a check has to say, with the place in the experiment file where it is changed."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import pairwise

from pivident.errors import PividentError
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
    ("channels", "frozen"): ("part",),
    ("channels", "wrapped"): ("columns", "q"),
    ("scale", "reach"): ("units", "q"),
    ("scale", "speed"): ("units", "q"),
    ("scale", "angle unit"): ("units", "q"),
    ("scale", "joint angle unit"): ("units", "q"),
    ("scale", "side"): ("side",),
    ("scale", "gain"): ("units", "tau"),
    ("scale", "assumed"): ("units", "tau"),
    ("order", "order"): ("columns", "tau"),
    ("delay", "late"): ("delay",),
    ("delay", "early"): ("delay",),
    ("delay", "joint late"): ("columns", "tau"),
    ("power", "sign"): ("units", "tau"),
    ("power", "weight"): ("units", "tau"),
    ("speed", "derivative"): ("columns", "dq_ref"),
    ("motion", "standstill"): ("columns", "q"),
    ("timing", "rate change"): ("part",),
    ("channels", "break"): ("part",),
    ("methods", "median"): ("bandpass", "median"),
}

#: Findings of single kinds that are fixed in the robot's table, by its key.
IN_ROBOT = {("power", "gravity at rest"): "gravity", ("scale", "load"): "model"}

#: Findings that are fixed elsewhere than in the table of their recording.
ELSEWHERE: dict[str, Place] = {"excitation": ("identify", "parameters"), "model": ("robot",)}


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
        follows = dict(pairwise(self.place)).get("recording", 0)
        number = follows if isinstance(follows, int) else 0
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


def of_error(error: PividentError, check: str, table: Place = (), kind: str = "refused") -> Remark:
    """An error that an identification would end with; it says its place below the table itself."""
    sentence, step = split_advice(" ".join(error.sentence.split()))
    place = (*(error.table or table), *error.place)
    return Remark("error", check, kind, sentence, next_step=step, place=place, refused=True)


def split_advice(text: str) -> tuple[str, str]:
    """What was seen and what to do: every message has the form ``what was seen; what to do``."""
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


def gravest_first(remarks: Iterable[Remark]) -> list[Remark]:
    """Remarks in order of severity, those that stop an identification first of all."""
    return sorted(remarks, key=lambda r: (-SEVERITIES.index(r.severity), not r.refused))
