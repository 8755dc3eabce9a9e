"""One sentence of the verdict, with its grade and the numbers that it stands on."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Grade = Literal["good", "note", "caution", "bad"]


@dataclass(frozen=True)
class Statement:
    """One sentence of the verdict.

    Attributes:
        topic: what it is about.
        grade: ``good``, ``note`` (neither good nor bad), ``caution`` or ``bad``.
        text: in plain words.
        evidence: the test and its numbers.
    """

    topic: str
    grade: Grade
    text: str
    evidence: str = ""

    def __str__(self) -> str:
        mark = {"good": "+", "note": "·", "caution": "!", "bad": "×"}[self.grade]
        return f"{mark} {self.topic}: {self.text}" + (
            f" [{self.evidence}]" if self.evidence else ""
        )
