"""Positions, speeds and accelerations as the estimator saw them: the paper's Figure A.9."""

from __future__ import annotations

from pivident.estimation.identification import FittedRecording, Identification
from pivident.report.plotly_figures import Figure, signal_figure
from pivident.report.sections.base import RecordingSection


class SignalsSection(RecordingSection):
    """One figure of three rows per joint and recording."""

    title = "Signals"
    anchor = "signals"
    template = "signals.html"

    def figures(
        self, identification: Identification, recording: FittedRecording, method: int
    ) -> tuple[Figure, ...]:
        """One figure per joint."""
        return tuple(
            signal_figure(identification, recording, joint, method, self.data.points)
            for joint in range(identification.robot.size)
        )
