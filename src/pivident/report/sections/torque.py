"""Measured against reconstructed torque: the paper's Figure 4."""

from __future__ import annotations

from typing import Any

from pivident.report.plotly_figures import torque_figure
from pivident.report.sections.base import RecordingSection


class TorqueSection(RecordingSection):
    """One small figure per joint and recording."""

    title = "Torque: measured and reconstructed"
    anchor = "torque"
    draw = staticmethod(torque_figure)

    def context(self) -> dict[str, Any]:
        """The figures, and whether the torque in them was measured."""
        records = (r for i in self.data.identifications for r in i.recordings)
        label = " or ".join(dict.fromkeys(r.torque_label for r in records))
        return super().context() | {"torque_label": label}
