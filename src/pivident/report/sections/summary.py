"""What was done, how it ended, and its reservations."""

from __future__ import annotations

from typing import Any

from pivident.estimation.summary_tables import ending, error_rows
from pivident.report.result_findings import disagreements, findings
from pivident.report.sections.base import Section


class SummarySection(Section):
    """One line per method, then the remarks in plain words."""

    title = "Summary"
    anchor = "summary"

    def context(self) -> dict[str, Any]:
        """Methods at a glance and remarks."""
        data = self.data
        apart = disagreements(data.identifications, data.labels)
        return {
            "methods": [
                (label, i, ending(i), error_rows(i))
                for label, i in zip(data.labels, data.identifications, strict=True)
            ],
            "remarks": [
                (label, findings(i, tests))
                for label, i, tests in zip(
                    data.labels,
                    data.identifications,
                    data.diagnostics.residuals.values(),
                    strict=True,
                )
            ],
            "disagreement": apart,
        }
