"""Names and messages that do nothing to the terminal, page or file that they end up in."""

from __future__ import annotations

import re

#: Control characters, line separators, and marks that turn the direction of writing.
_ACTIVE = "\\x00-\\x1f\\x7f-\\x9f\\u200e\\u200f\\u2028\\u2029\\u202a-\\u202e\\u2066-\\u2069"

_IN_NAMES = re.compile(f"[{_ACTIVE}]")
_IN_TEXTS = re.compile(f"(?![\\n\\t])[{_ACTIVE}]")


def is_printable(name: str) -> bool:
    """Whether a name has no characters that steer a terminal or break a line."""
    return _IN_NAMES.search(name) is None


def escaped(text: str) -> str:
    """The text with such characters written out (``\\x1b``); line ends and tabs stay.

    Args:
        text: what may come from a file.
    """
    return _IN_TEXTS.sub(lambda found: ascii(found.group())[1:-1], text)
