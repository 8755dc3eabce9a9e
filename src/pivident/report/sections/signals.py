"""Positions, speeds and accelerations as the estimator saw them: the paper's Figure A.9."""

from __future__ import annotations

from pivident.report.plotly_figures import signal_figure
from pivident.report.sections.base import RecordingSection


class SignalsSection(RecordingSection):
    """One figure of three rows per joint and recording."""

    title = "Signals"
    anchor = "signals"
    draw = staticmethod(signal_figure)
