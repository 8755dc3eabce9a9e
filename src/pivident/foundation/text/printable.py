"""Names and messages without effect on the terminal, page or file they are written to."""

from __future__ import annotations

import re

#: Control characters, line separators, and marks that change the direction of writing.
_ACTIVE = "\\x00-\\x1f\\x7f-\\x9f\\u200e\\u200f\\u2028\\u2029\\u202a-\\u202e\\u2066-\\u2069"

#: Longest message, in characters.
MAX_TEXT = 2000

_IN_NAMES = re.compile(f"[{_ACTIVE}]")
_IN_TEXTS = re.compile(f"(?![\\n\\t])[{_ACTIVE}]")


def is_printable(name: str) -> bool:
    """Whether a name has no characters that control a terminal or break a line."""
    return _IN_NAMES.search(name) is None


def shortened(text: str) -> str:
    """The text, or its beginning and end where it is longer than ``MAX_TEXT``."""
    return text if len(text) <= MAX_TEXT else f"{text[: MAX_TEXT - 300]} … {text[-300:]}"


def sheet_text(text: str) -> str:
    """A cell of text that a spreadsheet does not interpret as a formula."""
    return f"'{text}" if text[:1] in ("=", "+", "-", "@", "\t", "\r") else text


def escaped(text: str) -> str:
    r"""The text with such characters escaped (``\x1b``), except line ends and tabs."""
    return _IN_TEXTS.sub(lambda found: ascii(found.group())[1:-1], text)
