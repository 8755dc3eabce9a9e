"""At which frequencies is the residual not white? Its spectrum before and after whitening."""

from __future__ import annotations

from typing import Any

from pivident.report.sections.base import SignalSection
from pivident.report.spectrum_figures import spectra_figure
from pivident.validation.residuals.residual_spectrum import residual_spectra


class SpectraSection(SignalSection):
    """One figure per joint, over all recordings."""

    title = "Spectra of the residuals"
    anchor = "spectra"

    def context(self) -> dict[str, Any]:
        """One gallery per method with signals."""
        galleries = []
        for k, identification in enumerate(self.data.identifications):
            spectra = [own for own in residual_spectra(identification) if own is not None]
            galleries.append(self.gallery(k, *(spectra_figure(own, k) for own in spectra)))
        return {"galleries": galleries, "several": self.data.several, "fitted": self.data.fitted}
