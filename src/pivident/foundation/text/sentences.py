"""Half sentences as sentences, and back.

Lists of names, in a sentence and as they are typed.

A hint that names what was probably meant, as a sentence and as data.
"""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterable, Sequence

#: Words of an experiment file that keep their small letter at the start of a sentence.
_NAMES = {"q", "dq", "tau", "t", "kp", "kd", "ki", "kv", "rate", "mask", "delay", "files", "name"}

#: Between two sentences.
_BETWEEN = re.compile(r"(?<=[.:!?])\s+(?=[A-Z`])")


def capital(text: str) -> str:
    """A text with a capital letter in front; single and Greek ones are symbols and stay."""
    return text[:1].upper() + text[1:] if len(text) > 1 and text[0].isascii() else text


def sentence_of(text: str) -> str:
    """A half sentence as a sentence: a capital in front unless it is a name, a stop behind."""
    first = text.split(" ", 1)[0]
    plain_word = first.isalpha() and first.islower() and first not in _NAMES
    text = capital(text) if plain_word else text
    return text if text.endswith((".", "?", "!")) else f"{text}."


def first_sentence(text: str) -> str:
    """The sentence with which a text begins, where there is room for no more."""
    return _BETWEEN.split(text)[0]


def half_sentence(text: str) -> str:
    """A sentence without its capital and its stop, to go on with."""
    return text[:1].lower() + text[1:].rstrip(".")


#: Maximum number of names in one sentence.
MAX_LISTED = 8


def listed(names: Sequence[str], most: int = MAX_LISTED) -> str:
    """The first names of a list, and how many more there are, where these are more than one."""
    if len(names) <= most + 1:
        return ", ".join(names)
    return f"{', '.join(names[:most])} and {len(names) - most} more"


def plural(number: int, thing: str) -> str:
    """A number of things: 1 joint, 6 joints."""
    return f"{number} {thing}{'' if number == 1 else 's'}"


def separated(texts: Iterable[str]) -> list[str]:
    """Names of one text or several, with commas between them."""
    return [name for text in texts for name in map(str.strip, text.split(",")) if name]


class NearestNames(str):
    """A half sentence such as ``did you mean 'tau'?``.

    Attributes:
        meant: a name that is not known, and the nearest one that is; None where none is near.
    """

    meant: tuple[str, str] | None = None

    @classmethod
    def of(cls, text: str, name: str, near: Sequence[str]) -> NearestNames:
        """The hint in its words, with the name and those that are near it, the nearest first."""
        hint = cls(text)
        hint.meant = (name, near[0]) if near else None
        return hint


def nearest(name: str, known: Iterable[str]) -> NearestNames:
    """A half sentence that names the nearest known names, or lists all of them."""
    choices = list(known)
    close = near_names(name, choices)
    text = (
        f"did you mean {' or '.join(map(repr, close))}?"
        if close
        else f"known are {', '.join(map(repr, choices)) or 'none'}"
    )
    return NearestNames.of(text, name, close)


def near_names(name: str, known: Iterable[str], likeness: float = 0.6) -> list[str]:
    """Up to three known names that were probably meant, the nearest first.

    If no name is similar as written, case is ignored; if that finds none either, a name of the same
    letters in another order is accepted. ``likeness`` is the ratio of `difflib`, 0 to 1.
    """
    choices = list(known)
    close = difflib.get_close_matches(name, choices, n=3, cutoff=likeness)
    if close:
        return close
    plain = {choice.lower(): choice for choice in reversed(choices)}
    found = difflib.get_close_matches(name.lower(), plain, n=3, cutoff=likeness)
    return [plain[c] for c in found] or [c for c in choices if sorted(c) == sorted(name)]
