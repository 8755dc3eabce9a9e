"""What was done, how it ended, and its reservations."""

from __future__ import annotations

from typing import Any

from pivident.diagnostics.verdict import beside_verdict
from pivident.estimation.summary_tables import ending, error_rows
from pivident.report.result_findings import disagreements, findings
from pivident.report.sections.base import Section
from pivident.text.finding import Finding


class SummarySection(Section):
    """One line per method, then the remarks in plain words."""

    title = "Summary"
    anchor = "summary"

    def context(self) -> dict[str, Any]:
        """Methods at a glance and remarks."""
        data = self.data
        apart = disagreements(data.identifications, data.labels)
        names = list(data.diagnostics.identifications)
        noticed = {
            name: findings(i, tests)
            for name, i, tests in zip(
                names, data.identifications, data.diagnostics.residuals.values(), strict=True
            )
        }
        remarks: dict[tuple[str, ...], list[Finding]] = {}
        for holders, finding in beside_verdict(data.verdict, noticed):
            remarks.setdefault(holders, []).append(finding)
        return {
            "methods": [
                (label, i, ending(i), error_rows(i))
                for label, i in zip(data.labels, data.identifications, strict=True)
            ],
            "remarks": [
                ([(data.labels[names.index(n)], names.index(n)) for n in holders], own)
                for holders, own in remarks.items()
            ],
            "disagreement": apart,
        }
