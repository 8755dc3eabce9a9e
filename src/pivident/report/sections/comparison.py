"""Methods side by side: the paper's Table 1, and every parameter's intervals on one scale."""

from __future__ import annotations

import math
from typing import Any

from pivident.estimation.parameter_rows import CONTRADICTION, aligned_rows, largest_difference
from pivident.report.intervals import interval_drawing
from pivident.report.sections.base import Section


class ComparisonSection(Section):
    """Value and relative σ of each method, largest difference in combined σ."""

    title = "Methods compared"
    anchor = "comparison"

    @property
    def applies(self) -> bool:
        """Only with several methods."""
        return self.data.several

    def context(self) -> dict[str, Any]:
        """One entry per parameter with its rows, difference and drawing."""
        labels = self.data.labels
        entries: list[dict[str, Any]] = []
        for name, rows in aligned_rows(self.data.identifications, self.data.truth).items():
            distance, i, j = largest_difference(rows)
            entries.append(
                {
                    "name": name,
                    "rows": rows,
                    "any": next(row for row in rows if row is not None),
                    "distance": distance,
                    "pair": f"{labels[i]} – {labels[j]}",
                    "contradicts": distance > CONTRADICTION,
                    "drawing": interval_drawing(
                        rows,
                        labels,
                        with_zero=False,
                        consistent=self.data.consistent.get(name, ()),
                        nominal=self.data.nominal.get(name, math.nan),
                    ),
                }
            )
        return {
            "labels": labels,
            "consistent": sorted(
                {(c.method, c.label) for own in self.data.consistent.values() for c in own}
            ),
            "nominal": any(entry["drawing"].nominal is not None for entry in entries),
            "entries": entries,
            "truth": bool(self.data.truth),
            "contradiction": CONTRADICTION,
        }
