"""How the iteration went: its criteria, and the prefilters with which it ended."""

from __future__ import annotations

from typing import Any

from pivident.estimation.identification import Identification
from pivident.foundation.document.plot import Figure
from pivident.judgement.report.frequency_figures import prefilter_figure
from pivident.judgement.report.identification_figures import change_figure, distance_figure
from pivident.judgement.report.sections.base import Gallery, Section, sampling_rate
from pivident.judgement.validation.residuals.residual_spectrum import scaled_prefilters


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
