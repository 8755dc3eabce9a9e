"""Lists of names, in a sentence and as they are typed."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

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
