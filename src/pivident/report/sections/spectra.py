"""At which frequencies is the residual not white? Its spectrum before and after whitening."""

from __future__ import annotations

from typing import Any

from pivident.report.sections.base import Gallery, SignalSection
from pivident.report.spectrum_figures import spectra_figure
from pivident.validation.residuals.residual_spectrum import residual_spectra


class SpectraSection(SignalSection):
    """One figure per joint, over all recordings."""

    title = "Spectra of the residuals"
    anchor = "spectra"
    template = "spectra.html"

    def context(self) -> dict[str, Any]:
        """One gallery per method with signals."""
        galleries = []
        for k, identification in enumerate(self.data.identifications):
            figures = tuple(
                spectra_figure(own, k)
                for own in residual_spectra(identification)
                if own is not None
            )
            groups = (("", figures),)
            galleries.append(Gallery(self.data.labels[k], k, self.opened(k), groups))
        return {"galleries": galleries, "several": self.data.several}
