"""The recorded motion as a moving picture of the arm, on the same clock as the figures."""

from __future__ import annotations

from typing import Any

from pivident.report.motion import joint_ranges, motion_values
from pivident.report.sections.base import SignalSection


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
