"""Are the residuals white? Autocorrelations with their band: the paper's Figure 5."""

from __future__ import annotations

from typing import Any

from pivident.estimation.identification import FittedRecording, Identification
from pivident.report.figures import Figure, residual_figure
from pivident.report.sections.base import RecordingSection
from pivident.report.whiteness import PRACTICAL, whiteness


class ResidualsSection(RecordingSection):
    """One small figure per joint and recording."""

    title = "Residuals"
    anchor = "residuals"
    template = "residuals.html"

    def figures(
        self, identification: Identification, recording: FittedRecording, method: int
    ) -> tuple[Figure, ...]:
        """One figure per joint whose residual is long enough to be tested."""
        results = (
            (joint.name, whiteness(identification, recording, k))
            for k, joint in enumerate(identification.joints)
        )
        return tuple(residual_figure(name, result, method) for name, result in results if result)

    def context(self) -> dict[str, Any]:
        """The figures, and from which correlation on it matters."""
        return super().context() | {"practical": PRACTICAL}
