"""What was predicted before the robot moved, beside what its record gave."""

from __future__ import annotations

from typing import Any

from pivident.report.sections.base import Section


class DesignedMotionSection(Section):
    """Predicted and reached standard errors, one table for each design."""

    title = "Designed motion"
    anchor = "designed-motion"

    @property
    def applies(self) -> bool:
        """Only where a recording followed a design."""
        return bool(self.data.designs)

    def context(self) -> dict[str, Any]:
        """The tables with their sentences."""
        return {"designs": self.data.designs}
