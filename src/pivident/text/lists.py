"""Lists of names in a sentence."""

from __future__ import annotations

from collections.abc import Sequence

#: Maximum number of names in one sentence.
MAX_LISTED = 8


def listed(names: Sequence[str], most: int = MAX_LISTED) -> str:
    """The first names of a list, and how many more there are."""
    shown = ", ".join(names[:most])
    return shown if len(names) <= most else f"{shown} and {len(names) - most} more"
