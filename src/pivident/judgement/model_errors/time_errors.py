"""Offsets and loads that change with time: a drift, or a jump at an instant.

Electronics that warm up, a brake that drags or a force sensor that is set to zero anew change the
offset of a torque; something that is picked up, poured out or fed changes what the flange carries.
With the instant of a jump unknown, instants all over the records are tried, and then those near the
ones that were found (see `named_causes`).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from pivident.dynamics.parameters import Parameter, standard_parameters
from pivident.dynamics.regressor import Regressor
from pivident.dynamics.robot_regressor import regressor_of
from pivident.judgement.model_errors.cause import NEGLIGIBLE, Cause, Columns, RecordMotion, on_joint
from pivident.loop.motion.motion import Kinematics
from pivident.robot.description import Robot
from pivident.robot.joints import Joint

#: Instants that are tried, evenly over all records, and about each that was found on either side.
INSTANTS, NEARER = 15, 8
#: Unit of the time over which something drifts [s].
MINUTE = 60.0
#: A load at the flange: mass and first moments, the mass first, whose amplitude is the size.
LOAD = ("m", "mx", "my", "mz")


@dataclass(frozen=True)
class Instants:
    """Instants of jumps.

    Attributes:
        at: when, since the first record began [s].
        names: recordings, in whose time they are said.
        starts: when each of these began [s].
        apart: time between neighbours [s].
    """

    at: tuple[float, ...]
    names: tuple[str, ...]
    starts: tuple[float, ...]
    apart: float

    @classmethod
    def of(cls, kinematics: Sequence[Kinematics]) -> Instants:
        """Evenly over all records, and where each of them begins."""
        lengths = [k.recording.duration for k in kinematics]
        *starts, end = np.concatenate([[0.0], np.cumsum(lengths)]).tolist()
        even = np.linspace(0.0, end, INSTANTS + 2)[1:-1].tolist()
        at = tuple(sorted({*even, *starts[1:]}))
        names = tuple(k.recording.name for k in kinematics)
        return cls(at, names, tuple(starts), end / (INSTANTS + 1))

    def near(self, found: Sequence[float]) -> Instants:
        """Those near some of them: as many on either side as there are steps to the next one."""
        apart = self.apart / NEARER
        steps = apart * np.arange(1 - NEARER, NEARER)
        at = tuple(sorted({instant + step for instant in found for step in steps.tolist()}))
        return Instants(at, self.names, self.starts, apart)

    def text(self, instant: float) -> str:
        """``14.2 s``, or ``6.2 s of second`` where there are several recordings."""
        if len(self.starts) < 2:
            return f"{instant:.1f} s"
        number = max(int(np.searchsorted(self.starts, instant, "right")) - 1, 0)
        return f"{instant - self.starts[number]:.1f} s of {self.names[number]}"


def time_causes(robot: Robot, instants: Instants) -> Iterator[Cause]:
    """Drift and jumps of each joint's offset, and of the load at the flange of a tree.

    Args:
        robot: as described.
        instants: when something may jump.
    """
    for j, joint in enumerate(robot.joints):
        if joint.motion == "driven":
            yield from _offsets(joint, j, instants)
    if robot.constraints is None and robot.joints[-1].motion == "driven":
        yield from _loads(robot, instants)


def _offsets(joint: Joint, j: int, instants: Instants) -> Iterator[Cause]:
    """A drift of one joint's offset, and jumps."""
    name, unit = joint.name, joint.torque_unit

    def torques(motion: RecordMotion) -> np.ndarray:
        return on_joint(j, [np.ones(motion.q.shape[1])], motion)

    what = "the offset", f"the offset of {name}"
    yield _drifts("offset drift", name, what, unit, torques)
    for instant in instants.at:
        when = instants.text(instant)
        yield _jumps("offset jump", name, what, unit, torques, instant, when)


def _loads(robot: Robot, instants: Instants) -> Iterator[Cause]:
    """A drift of the load at the flange, and jumps."""
    own = {p.stem: p for p in standard_parameters(robot) if p.joint == robot.size - 1}
    torques = torques_of([own[stem] for stem in LOAD])
    name, what = robot.joint_names[-1], ("the mass at the flange", "the load at the flange")
    yield _drifts("load drift", name, what, "kg", torques, len(LOAD))
    for instant in instants.at:
        when = instants.text(instant)
        yield _jumps("load jump", name, what, "kg", torques, instant, when, len(LOAD))


def _drifts(
    kind: str, name: str, what: tuple[str, str], unit: str, torques: Columns, count: int = 1
) -> Cause:
    """Torques that grow with the time; ``what``: in the name and in the sentence."""
    return Cause(
        kind,
        name,
        f"drift of {what[0]}",
        f"{unit}/min",
        lambda motion: torques(motion) * motion.seconds / MINUTE,
        count,
        by_first=True,
        is_smooth=True,
        least_torque=NEGLIGIBLE,
        phrase=f"{what[1]} drifts by {{size}}",
    )


def _jumps(
    kind: str,
    name: str,
    what: tuple[str, str],
    unit: str,
    torques: Columns,
    instant: float,
    when: str,
    count: int = 1,
) -> Cause:
    """Torques from an instant on; ``when``: in words."""
    return Cause(
        kind,
        name,
        f"jump of {what[0]} at {when}",
        unit,
        lambda motion: torques(motion) * (motion.seconds >= instant),
        count,
        by_first=True,
        is_smooth=True,
        least_torque=NEGLIGIBLE,
        phrase=f"{what[1]} jumped by {{size}} at {when}",
        instant=instant,
    )


def torques_of(parameters: Sequence[Parameter]) -> Columns:
    """Columns of parameters: torque of each at one, shape (columns, joints, samples)."""

    @lru_cache(maxsize=1)
    def regressor(robot: Robot) -> Regressor:
        return regressor_of(robot, parameters)

    @lru_cache(maxsize=1)
    def columns(motion: RecordMotion) -> np.ndarray:
        matrix = regressor(motion.robot).matrix(motion.q.T, motion.dq.T, motion.ddq.T)
        return np.ascontiguousarray(matrix.transpose(2, 1, 0))

    return columns
