"""Measured against reconstructed torque: the paper's Figure 4."""

from __future__ import annotations

from pivident.estimation.identification import FittedRecording, Identification
from pivident.report.plotly_figures import Figure, torque_figure
from pivident.report.sections.base import RecordingSection


class TorqueSection(RecordingSection):
    """One small figure per joint and recording."""

    title = "Torque: measured and reconstructed"
    anchor = "torque"
    template = "torque.html"

    def figures(
        self, identification: Identification, recording: FittedRecording, method: int
    ) -> tuple[Figure, ...]:
        """One figure per joint."""
        return tuple(
            torque_figure(identification, recording, joint, method, self.data.points)
            for joint in range(identification.robot.size)
        )
