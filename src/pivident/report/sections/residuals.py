"""Are the residuals white? Autocorrelations with their band: the paper's Figure 5."""

from __future__ import annotations

from typing import Any

from pivident.report.plotly_figures import residual_figure
from pivident.report.sections.base import Gallery, SignalSection
from pivident.validation.residuals.autocorrelation import PRACTICAL_CORRELATION


class ResidualsSection(SignalSection):
    """One small figure per joint, over all recordings."""

    title = "Residuals"
    anchor = "residuals"
    template = "residuals.html"

    def context(self) -> dict[str, Any]:
        """The figures, and from which correlation on it matters."""
        galleries = []
        for k, tests in enumerate(self.data.diagnostics.residuals.values()):
            figures = tuple(residual_figure(joint, k) for joint in tests.joints)
            groups = (("", figures),)
            galleries.append(Gallery(self.data.labels[k], k, self.opened(k), groups))
        return {
            "galleries": galleries,
            "left_out_names": (),
            "several": self.data.several,
            "practical": PRACTICAL_CORRELATION,
        }
