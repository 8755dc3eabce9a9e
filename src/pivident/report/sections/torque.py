"""Measured against reconstructed torque: the paper's Figure 4."""

from __future__ import annotations

from pivident.report.plotly_figures import torque_figure
from pivident.report.sections.base import RecordingSection


class TorqueSection(RecordingSection):
    """One small figure per joint and recording."""

    title = "Torque: measured and reconstructed"
    anchor = "torque"
    draw = staticmethod(torque_figure)
