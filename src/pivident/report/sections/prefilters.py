"""The prefilters that the noise models made: L_j of IDIM-PIV."""

from __future__ import annotations

from typing import Any

from pivident.estimation.identification import Identification
from pivident.report.frequency_figures import prefilter_figure
from pivident.report.plotly_figures import Figure
from pivident.report.recipes import sampling_rate
from pivident.report.sections.base import Gallery, Section
from pivident.validation.residuals.residual_spectrum import scaled_prefilters


class PrefiltersSection(Section):
    """One Bode plot per joint of each method that prefilters."""

    title = "Prefilters"
    anchor = "prefilters"

    @property
    def applies(self) -> bool:
        """Only with a method that prefilters."""
        return any(map(_prefilters, self.data.identifications))

    def context(self) -> dict[str, Any]:
        """One gallery per method."""
        prefiltering = [k for k, i in enumerate(self.data.identifications) if _prefilters(i)]
        return {
            "galleries": [
                Gallery(self.data.labels[k], k, k == prefiltering[-1], (("", self._figures(k)),))
                for k in prefiltering
            ],
            "several": len(prefiltering) > 1,
        }

    def _figures(self, method: int) -> tuple[Figure, ...]:
        identification = self.data.identifications[method]
        filters = scaled_prefilters(identification)
        assert filters is not None
        rate = sampling_rate(identification)
        return tuple(
            prefilter_figure(fit.name, fit.torque_unit, own, rate, method)
            for fit, own in zip(identification.joints, filters, strict=True)
        )


def _prefilters(identification: Identification) -> bool:
    """Whether equations of the torque were prefiltered and solved; a simulation's are tested only.

    Filters of simulation errors have orders in the section about them.
    """
    return identification.simulation is None and scaled_prefilters(identification) is not None
