"""The estimates of each method with their intervals, and their errors where truth is known."""

from __future__ import annotations

from typing import Any

from pivident.estimation.parameter_rows import parameter_rows
from pivident.estimation.summary_tables import name_lines
from pivident.report.intervals import interval_drawing
from pivident.report.sections.base import Section


class ParametersSection(Section):
    """One table per method."""

    title = "Parameters"
    anchor = "parameters"

    def context(self) -> dict[str, Any]:
        """Rows and drawings of each method."""
        data = self.data
        tables = []
        for k, (label, identification) in enumerate(
            zip(data.labels, data.identifications, strict=True)
        ):
            rows = parameter_rows(identification, data.truth)
            others = [None] * k
            drawings = [
                interval_drawing(
                    [*others, row],
                    data.labels,
                    with_zero=True,
                    consistent=[c for c in data.consistent.get(row.name, ()) if c.method == k],
                )
                for row in rows
            ]
            tables.append(
                {
                    "label": label,
                    "method": k,
                    "opened": self.opened(k),
                    "rows": list(zip(rows, drawings, strict=True)),
                }
            )
        held = any(i.simulation is not None and i.simulation.held for i in data.identifications)
        return {
            "tables": tables,
            "truth": bool(data.truth),
            "several": data.several,
            "held": held,
            "name_lines": name_lines(data.identifications),
        }
