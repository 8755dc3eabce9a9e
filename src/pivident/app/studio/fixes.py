"""What a remark of the check asks for as edits of the experiment file, ready to be applied.

A remark carries its repairs as data; here they become the buttons beside it. Those that the file
contradicts are left out, and a remark that leaves open what is right has none.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from pivident.experiment.edited_file import Edits, edited, edits_for
from pivident.foundation.errors import PividentError
from pivident.foundation.text.repair import Repair


@dataclass(frozen=True)
class Fix:
    """One way to do what a remark asks for.

    Attributes:
        words: what is done, a sentence.
        edits: place and new value as TOML, in their order; None: removed.
    """

    words: str
    edits: Edits


def fixes(remark: Mapping[str, Any], text: str) -> tuple[Fix, ...]:
    """Ways to do what a remark asks for, the most likely first; empty where none is definite.

    Each has been tried on the text.

    Args:
        remark: an entry of ``check.json``, with ``joints``, the names of the robot's joints.
        text: the experiment file that was checked.
    """
    ways: list[Fix] = []
    for content in remark.get("repairs", ()):
        try:
            repair = Repair.of_json(content)
            fix = Fix(*edits_for(repair, text, tuple(remark.get("joints", ()))))
            works = edited(text, fix.edits) != text
        except (PividentError, ValueError):
            continue
        if works and all(fix.edits != other.edits for other in ways):
            ways.append(fix)
    return tuple(ways)
