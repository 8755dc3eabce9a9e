"""The arm and its recorded motion for the moving picture of a page, small at any rate."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from pivident.estimation.identification import FittedRecording, Identification
from pivident.robot.description import Robot

#: Positions of all joints and recordings together; one takes 7 bytes of the page.
MAX_POSITIONS = 36_000

#: Instants per second that suffice: positions between them are interpolated.
RATE = 60.0

#: Digits of a position [rad or m]: 0.006 degrees.
DIGITS = 4


class Moved(Protocol):
    """A recording as far as its motion goes."""

    @property
    def name(self) -> str:
        """Its name."""

    @property
    def t(self) -> np.ndarray:
        """Times, which do not go backward, shape (samples,) [s]."""

    @property
    def q_measured(self) -> np.ndarray:
        """Positions, shape (samples, joints) [rad or m]."""


@dataclass(frozen=True)
class JointRange:
    """What one joint did in a recording."""

    name: str  # joint
    unit: str  # rad or m
    low: float  # lowest position [unit]
    high: float  # highest position [unit]
    speed: float  # highest speed, as estimated [unit/s]


def motion_values(robot: Robot, recordings: Sequence[Moved]) -> dict[str, Any]:
    """Robot and positions as plain values, for the script that draws them.

    ``joints``: name, kind, parent, rotation by rows and translation of each, whether its axis and
    whether the way to it are drawn; ``rows``: those of the table of positions; ``tip``: point of
    each link that is drawn where nothing hangs on it [m]; ``ends``: link (-1: the base) and point
    of each end of a loop, to which a bar is drawn; ``up``: direction against gravity;
    ``recordings``: name, start and duration [s], and ``q``, a list for each joint at equal
    distances of time.
    """
    tree, real = robot.tree, _real(robot.tree)
    most = max(2, MAX_POSITIONS // max(1, tree.size * len(recordings)))
    size = np.linalg.norm(robot.gravity)
    up = -robot.gravity / size if size > 0.0 else np.array([0.0, 0.0, 1.0])
    return {
        "joints": [
            {
                "name": joint.name,
                "kind": joint.kind,
                "parent": joint.parent,
                "rotation": [round(float(x), 9) for x in joint.rotation.ravel()],
                "translation": [round(float(x), 6) for x in joint.translation],
                "axis": real[index],
                "way": real[index] and (joint.parent < tree.base_joints or real[joint.parent]),
            }
            for index, joint in enumerate(tree.joints)
        ],
        "rows": list(robot.places),
        "tip": [_tip(robot, index) for index in range(tree.size)],
        "ends": [
            [link, *(round(float(x), 6) for x in frame.translation)]
            for closure in (robot.constraints.closures if robot.constraints else ())
            for link, frame in zip(closure.links, closure.frames, strict=True)
        ],
        "up": [round(float(x), 6) for x in up],
        "recordings": [_recording_values(robot, recording, most) for recording in recordings],
    }


def joint_ranges(
    identification: Identification, recording: FittedRecording
) -> tuple[JointRange, ...]:
    """Range and highest speed of each joint, which is the motion in words."""
    return tuple(
        JointRange(
            name=joint.name,
            unit=joint.position_unit,
            low=float(np.nanmin(recording.q_measured[:, j])),
            high=float(np.nanmax(recording.q_measured[:, j])),
            speed=float(np.nanmax(np.abs(recording.dq[:, j]))),
        )
        for j, joint in enumerate(identification.robot.joints)
    )


def _recording_values(robot: Robot, recording: Moved, most: int) -> dict[str, Any]:
    """Positions at equal distances of time; gaps of a joint are bridged by straight lines.

    Passive joints follow from those that are measured.
    """
    t = recording.t - recording.t[0]
    instants = np.linspace(0.0, t[-1], int(np.clip(np.ceil(t[-1] * RATE) + 1, 2, most)))
    columns = []
    for q in np.asarray(recording.q_measured, dtype=float).T:
        seen = np.isfinite(q)
        values = np.interp(instants, t[seen], q[seen]) if seen.any() else np.zeros(instants.size)
        columns.append(values)
    if robot.constraints is not None:
        from pivident.dynamics.closed_chains.closed_motion import ClosedChains

        still = np.zeros((len(columns), instants.size))
        columns = list(ClosedChains(robot).motion(np.array(columns), still, still).q)
    return {
        "name": recording.name,
        "start": float(recording.t[0]),
        "duration": float(t[-1]),
        "q": [[round(float(x), DIGITS) for x in values] for values in columns],
    }


def _real(tree: Robot) -> list[bool]:
    """Joints that are built: not those of a measured base, and no slides that carry no body.

    Such slides say where a platform is that does not turn.
    """
    return [
        joint.motion == "driven" and (link.is_body or joint.kind == "revolute")
        for joint, link in zip(tree.joints, tree.links, strict=True)
    ]


def _tip(machine: Robot, index: int) -> list[float] | None:
    """Where a last link is drawn to: its centre of mass, else a little along its joint's axis.

    One that closes a loop ends there.
    """
    robot, constraints = machine.tree, machine.constraints
    closures = constraints.closures if constraints else ()
    if any(joint.parent == index for joint in robot.joints):
        return None
    if any(index in closure.links for closure in closures):
        return None
    reach = sum(float(np.linalg.norm(joint.translation)) for joint in robot.joints) or 1.0
    inertia = robot.links[index].inertia
    if inertia[9] > 0.0:
        center = inertia[6:9] / inertia[9]
        if 0.02 * reach < np.linalg.norm(center) < reach:
            return [round(float(x), 6) for x in center]
    return [0.0, 0.0, round(0.1 * reach, 6)]
