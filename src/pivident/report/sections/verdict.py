"""Should one believe it? The verdict, at the head of the page."""

from __future__ import annotations

from typing import Any

from pivident.report.sections.base import Section
from pivident.validation.verdict import verdict


class VerdictSection(Section):
    """Which estimate to take, and one sentence for each thing that speaks for or against it."""

    title = "Verdict"
    anchor = "verdict"
    template = "verdict.html"

    def context(self) -> dict[str, Any]:
        """The verdict, and the colour of the method that it recommends."""
        found = verdict(self.material.examination)
        names = list(self.material.examination.identifications)
        return {
            "verdict": found,
            "method": names.index(found.name),
            "label": self.material.labels[names.index(found.name)],
        }
