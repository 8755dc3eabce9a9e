"""Are the residuals white? Autocorrelations (the paper's Figure 5), spectra, and all tests."""

from __future__ import annotations

from typing import Any

import numpy as np

from pivident.foundation.document.plot import (
    ERROR,
    LEGEND,
    MEASURED,
    SHADE,
    Figure,
    Plot,
    colour,
    empty_plot,
    packed,
)
from pivident.foundation.text.numbers import format_significant, percent
from pivident.judgement.report.identification_figures import residual_figure
from pivident.judgement.report.sections.base import Section, SignalSection
from pivident.judgement.validation.residuals.autocorrelation import PRACTICAL_CORRELATION
from pivident.judgement.validation.residuals.residual_spectrum import (
    ResidualSpectra,
    Spectrum,
    residual_spectra,
)


def spectra_figure(spectra: ResidualSpectra, method: int) -> Figure:
    """Torque residual with its noise model above, whitened residual in its band below."""
    white, level = spectra.white, spectra.white_level
    plot = empty_plot("")
    plot.x_axis("frequency [Hz]", type="log")
    plot.update(showlegend=True, legend=LEGEND)
    below = {"title": {"text": "re white", "standoff": 4}, "type": "log", "dtick": 1}
    below["exponentformat"] = "power"
    both = spectra.model is not None
    if both:
        residual = f"residual [({spectra.torque_unit})²/Hz]"
        plot.y_axis(residual, domain=[0.44, 1.0], type="log", exponentformat="power")
        plot.update(yaxis2={"domain": [0.0, 0.36], **below}, xaxis={"anchor": "y2"})
        _line(plot, spectra.torque, spectra.torque.density, "residual", MEASURED, 1.4, "y")
        assert spectra.model is not None
        _line(plot, spectra.torque, spectra.model, "noise model", colour(method), 1.8, "y")
    else:
        plot.update(yaxis=below | {"title": {"text": "residual, re white", "standoff": 4}})
    axis = "y2" if both else "y"
    low, high = white.band(1.0)
    plot.add(
        x=packed(np.r_[white.frequency, white.frequency[::-1]]),
        y=packed(np.r_[high, low[::-1]]),
        yaxis=axis,
        mode="lines",
        fill="toself",
        fillcolor=SHADE,
        line={"width": 0, "color": MEASURED},
        hoverinfo="skip",
        name="95 % of a white residual",
    )
    name = "whitened" if both else "residual"
    _line(plot, white, white.density / level, name, ERROR if both else colour(method), 1.4, axis)
    outside = 100.0 * white.outside(level)
    most = int(np.argmax(white.density))
    note = (
        f"{percent(outside)} of the bins outside the 95 % band of a white residual (5 % expected); "
        f"largest {format_significant(white.density[most] / level, 2)} times white at "
        f"{format_significant(white.frequency[most])} Hz; {white.stretches} stretches of "
        f"{white.length} samples" + (", gaps filled with zeros" if white.filled else "")
    )
    what = "before and after whitening, with its noise model" if both else "re white noise"
    label = f"Spectrum of the residual of {spectra.name} {what}: {note}"
    return Figure(plot, 400 if both else 260, spectra.name, label, note)


def _line(
    plot: Plot, spectrum: Spectrum, values: np.ndarray, name: str, own: str, width: float, axis: str
) -> None:
    plot.add(
        x=packed(spectrum.frequency),
        y=packed(values),
        yaxis=axis,
        mode="lines",
        name=name,
        line={"color": own, "width": width},
    )


class ResidualsSection(SignalSection):
    """One small figure per joint, over all recordings."""

    title = "Residuals"
    anchor = "residuals"

    def context(self) -> dict[str, Any]:
        """The figures, and from which correlation on it matters."""
        galleries = [
            self.gallery(k, *(residual_figure(j, k) for j in tests.joints))
            for k, tests in enumerate(self.data.diagnostics.residuals.values())
        ]
        return {
            "galleries": galleries,
            "left_out_names": (),
            "several": self.data.several,
            "fitted": self.data.fitted,
            "practical": PRACTICAL_CORRELATION,
        }


class SpectraSection(SignalSection):
    """One figure per joint, over all recordings."""

    title = "Spectra of the residuals"
    anchor = "spectra"

    def context(self) -> dict[str, Any]:
        """One gallery per method with signals."""
        galleries = [
            self.gallery(
                k, *(spectra_figure(own, k) for own in residual_spectra(i) if own is not None)
            )
            for k, i in enumerate(self.data.identifications)
        ]
        return {"galleries": galleries, "several": self.data.several, "fitted": self.data.fitted}


class TestsSection(Section):
    """One table of residual tests for each method; sentences about its instruments."""

    __test__ = False  # not a test class, whatever its name looks like

    title = "Tests"
    anchor = "tests"

    def context(self) -> dict[str, Any]:
        """Tests by method."""
        diagnostics = self.data.diagnostics
        entries = [
            (
                self.data.labels[k],
                k,
                self.opened(k),
                diagnostics.residuals[name],
                diagnostics.instruments.get(name),
            )
            for k, name in enumerate(diagnostics.identifications)
        ]
        return {"entries": entries, "fitted": self.data.fitted}
