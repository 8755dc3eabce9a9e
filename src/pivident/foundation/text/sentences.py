"""Half sentences as sentences, and back."""

from __future__ import annotations

import re

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
