"""Half sentences as sentences, and back."""

from __future__ import annotations

#: Words of an experiment file that keep their small letter at the start of a sentence.
_NAMES = {"q", "dq", "tau", "t", "kp", "kd", "ki", "kv", "rate", "mask", "delay", "files", "name"}


def capital(text: str) -> str:
    """A text with a capital letter in front."""
    return text[:1].upper() + text[1:]


def sentence_of(text: str) -> str:
    """A half sentence as a sentence: a capital in front unless it is a name, a stop behind."""
    first = text.split(" ", 1)[0]
    plain_word = first.isalpha() and first.islower() and first not in _NAMES
    text = capital(text) if plain_word else text
    return text if text.endswith((".", "?", "!")) else f"{text}."


def half_sentence(text: str) -> str:
    """A sentence without its capital and its stop, to go on with."""
    return text[:1].lower() + text[1:].rstrip(".")
