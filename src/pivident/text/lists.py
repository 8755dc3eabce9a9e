"""Lists of names in a sentence."""

from __future__ import annotations

from collections.abc import Sequence

#: Names listed in one sentence.
LISTED = 8


def listed(names: Sequence[str]) -> str:
    """The first names of a list, and how many more there are.

    Args:
        names: of parameters or joints.
    """
    shown = ", ".join(names[:LISTED])
    return shown if len(names) <= LISTED else f"{shown} and {len(names) - LISTED} more"
