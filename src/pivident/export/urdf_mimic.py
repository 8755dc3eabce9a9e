"""Joints of a URDF that follow others, q = multiplier · q of the leader + offset."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from pivident.errors import ExportError
from pivident.export.xml_text import number, quoted
from pivident.models.exported import refuse_loops
from pivident.robot.description import Joint, Robot
from pivident.robot.proportions import proportions


@dataclass(frozen=True)
class Mimic:
    """How a joint follows another one."""

    leader: int  # index of the leading joint in the tree
    multiplier: float
    offset: float  # [rad or m]

    def element(self, robot: Robot) -> str:
        """The element of the follower."""
        return (
            f"<mimic joint={quoted(robot.tree.joints[self.leader].name)} "
            f'multiplier="{number(self.multiplier)}" offset="{number(self.offset)}"/>'
        )

    def limits(self, leader: Joint, unknown: tuple[float, float]) -> tuple[float, float]:
        """Range of the follower where the leader moves within its own."""
        ends = [self.multiplier * end + self.offset for end in leader.position_limits or unknown]
        return min(ends), max(ends)


def mimics(robot: Robot) -> Mapping[int, Mimic]:
    """Followers by their index in the tree.

    Raises:
        RobotDescriptionError: links form closed loops.
        ExportError: a joint follows several others.
    """
    found = proportions(robot)
    if found is None:
        refuse_loops(robot, "URDF")
        return {}
    ratios, rest = found
    made: dict[int, Mimic] = {}
    for i, joint in enumerate(robot.tree.joints):
        if i in robot.places:
            continue
        leaders = np.flatnonzero(ratios[i])
        if len(leaders) > 1:
            names = " and ".join(repr(robot.joints[a].name) for a in leaders)
            raise ExportError(
                f"joint {joint.name!r} follows {names}, and <mimic> of a URDF names one joint; "
                "export it as MJCF, or as JSON, which read_model reads back"
            )
        # one that stands still follows any joint by nothing
        a = int(leaders[0]) if leaders.size else 0
        made[i] = Mimic(robot.places[a], float(ratios[i, a]), float(rest[i]))
    return made
