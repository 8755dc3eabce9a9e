"""How the iteration went, for methods that iterate."""

from __future__ import annotations

from typing import Any

from pivident.report.plotly_figures import change_figure, distance_figure
from pivident.report.sections.base import Section


class ConvergenceSection(Section):
    """Parameters and criteria over the iterations."""

    title = "Convergence"
    anchor = "convergence"

    @property
    def applies(self) -> bool:
        """Only with a method that iterated."""
        return any(i.iterations > 1 for i in self.data.identifications)

    def context(self) -> dict[str, Any]:
        """Figures and table of each method that iterated."""
        data = self.data
        return {
            "entries": [
                (
                    self.gallery(k, distance_figure(i), change_figure(i)),
                    i.history,
                    i.simulation is not None,
                )
                for k, i in enumerate(data.identifications)
                if i.iterations > 1
            ],
            "several": data.several,
        }
