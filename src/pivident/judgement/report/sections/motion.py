"""The motion as the estimator saw it (the paper's Figure A.9), its torque (Figure 4), its replay.

The account of a designed motion stands beside them.
"""

from __future__ import annotations

from typing import Any

from pivident.judgement.report.identification_figures import signal_figure, torque_figure
from pivident.judgement.report.motion import joint_ranges, motion_values
from pivident.judgement.report.sections.base import RecordingSection, Section, SignalSection


class SignalsSection(RecordingSection):
    """One figure of three rows per joint and recording."""

    title = "Signals"
    anchor = "signals"
    draw = staticmethod(signal_figure)


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


class ReplaySection(SignalSection):
    """The arm in three dimensions, and the range of each joint for those who do not see it."""

    title = "The motion, replayed"
    anchor = "replay"

    def context(self) -> dict[str, Any]:
        """Robot and motion of the last identification that has signals."""
        shown = [i for i in self.data.identifications if i.recordings][-1]
        recordings = self.data.drawn(shown.recordings)
        return {
            "robot": shown.robot,
            "motion": motion_values(shown.robot, recordings),
            "ranges": [(r.name, joint_ranges(shown, r)) for r in recordings],
            "left_out_names": self.data.left_out,
        }


class DesignedMotionSection(Section):
    """Predicted and reached standard errors, one table for each design."""

    title = "Designed motion"
    anchor = "designed-motion"

    @property
    def applies(self) -> bool:
        """Only where a recording followed a design."""
        return bool(self.data.designs)

    def context(self) -> dict[str, Any]:
        """The tables with their sentences."""
        return {"designs": self.data.designs}
