"""Are the residuals white? Autocorrelations with their band: the paper's Figure 5."""

from __future__ import annotations

from typing import Any

from pivident.report.plotly_figures import residual_figure
from pivident.report.sections.base import SignalSection
from pivident.validation.residuals.autocorrelation import PRACTICAL_CORRELATION


class ResidualsSection(SignalSection):
    """One small figure per joint, over all recordings."""

    title = "Residuals"
    anchor = "residuals"

    def context(self) -> dict[str, Any]:
        """The figures, and from which correlation on it matters."""
        galleries = []
        for k, tests in enumerate(self.data.diagnostics.residuals.values()):
            galleries.append(self.gallery(k, *(residual_figure(j, k) for j in tests.joints)))
        return {
            "galleries": galleries,
            "left_out_names": (),
            "several": self.data.several,
            "fitted": self.data.fitted,
            "practical": PRACTICAL_CORRELATION,
        }
