"""One thing that a check has to say, with the place in the experiment file where it is changed.

What the checks of channels share.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from pivident.foundation.errors import Advised, PividentError
from pivident.foundation.text.finding import SEVERITIES, Finding
from pivident.foundation.text.repair import Place, Repair, Respelt, placed
from pivident.foundation.text.sentences import sentence_of


@dataclass(frozen=True)
class Remark(Finding):
    """A finding about an experiment, with its place in the file.

    Attributes:
        line: its line in the file, counted from 1, or None.
        refused: whether an identification would stop at it.
    """

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

    def as_json(self) -> dict[str, Any]:
        """As of every finding; the place is always there."""
        content = super().as_json() | {"place": list(self.place)}
        repairs = {"repairs": content.pop("repairs")} if self.repairs else {}
        return content | repairs  # behind the others

    @property
    def group(self) -> tuple[object, ...]:
        """As of every finding; what is changed elsewhere is another remark."""
        return *super().group, self.place, self.refused


def of_finding(finding: Finding, table: Place = (), refused: bool = False) -> Remark:
    """A finding as a remark about the experiment file.

    Args:
        finding: of a check.
        table: of the recording that it is about.
        refused: whether an identification stops at it, besides those of its kind.
    """
    return Remark(
        **vars(finding)
        | {
            "place": placed(finding.place, table),
            "repairs": tuple(repair.below(table) for repair in finding.repairs),
        },
        refused=refused or (finding.declared is not None and finding.declared.stops),
    )


def of_error(error: PividentError, check: str, table: Place = (), kind: str = "refused") -> Remark:
    """An error that an identification would end with; it says its place below the table itself."""
    sentence, step = advised(error)
    place = (*(error.table or table), *error.place)
    repairs = () if error.meant is None else (Repair((Respelt(place, *error.meant),)),)
    return Remark(
        "error", check, kind, sentence, "", step, place=place, repairs=repairs, refused=True
    )


def advised(error: Advised) -> tuple[str, str]:
    """What was seen and what to do, as sentences on one line."""
    fact, advice = (" ".join(text.split()) for text in (error.fact, error.advice))
    return sentence_of(fact), sentence_of(advice) if advice else ""


def gravest_first(remarks: Iterable[Remark]) -> list[Remark]:
    """Remarks in order of severity, those that stop an identification first of all."""
    return sorted(remarks, key=lambda r: (-SEVERITIES.index(r.severity), not r.refused))


def usable_rows(*channels: np.ndarray) -> np.ndarray:
    """Indices of the samples at which every value of every channel is finite."""
    return np.flatnonzero(np.logical_and.reduce([np.isfinite(c).all(axis=1) for c in channels]))
