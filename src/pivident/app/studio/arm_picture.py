"""The arm in motion, for the picture of a page: as it was logged, or each joint swept in turn."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pivident.foundation.errors import PividentError
from pivident.judgement.report.motion import motion_values
from pivident.robot.description import Robot
from pivident.robot.gallery import load_robot
from pivident.robot.naming import ROBOT_FILES

#: Sweep of a joint that turns, from its middle to both sides, where its limits are wider [rad], and
#: of one that slides [m].
SWEEP, SLIDE = 1.0, 0.3

#: Time of the sweep of one joint [s], and instants of it.
SECONDS, INSTANTS = 4.0, 61


@dataclass(frozen=True, eq=False)
class Swept:
    """Positions of all joints over time."""

    name: str  # what moves
    t: np.ndarray  # times [s]
    q_measured: np.ndarray  # positions, shape (samples, joints) [rad or m]


def robot_picture(model: str, folder: Path) -> dict[str, Any]:
    """The arm alone, before there is a log: each joint moves slowly inside its limits.

    Args:
        model: gallery name, or a robot file relative to the folder.
        folder: of the project.

    Returns:
        What the script of the picture draws, or ``error``: why there is none.
    """
    try:
        is_file = model.endswith(ROBOT_FILES)
        robot = load_robot(str(folder / model) if is_file else model).on_fixed_base
        return motion_of(robot, [sweep(robot)])
    except (PividentError, OSError) as error:
        return {"error": " ".join(str(error).split())}


def motion_of(robot: Robot, recordings: Sequence[Swept]) -> dict[str, Any]:
    """Robot and positions as plain values, or ``error``: why there is no picture.

    Args:
        robot: the robot.
        recordings: positions of its joints.
    """
    try:
        return motion_values(robot, recordings)
    except (PividentError, np.linalg.LinAlgError, ValueError) as error:
        return {"error": " ".join(str(error).split())}


def sweep(robot: Robot) -> Swept:
    """Each joint in turn from its middle to both sides and back."""
    phase = np.linspace(0.0, 2.0 * np.pi, INSTANTS)
    middle, reach = np.zeros(robot.size), np.zeros(robot.size)
    for j, joint in enumerate(robot.joints):
        widest = SWEEP if joint.kind == "revolute" else SLIDE
        low, high = joint.position_limits or (-widest, widest)
        low, high = (x if np.isfinite(x) else side * widest for x, side in ((low, -1), (high, 1)))
        middle[j] = 0.0 if low < 0.0 < high else (low + high) / 2.0
        reach[j] = min(widest, 0.9 * min(middle[j] - low, high - middle[j]))
    q = np.tile(middle, (robot.size, INSTANTS, 1))
    for j in range(robot.size):
        q[j, :, j] += reach[j] * np.sin(phase)
    t = np.linspace(0.0, SECONDS * robot.size, robot.size * INSTANTS)
    return Swept(robot.name, t, q.reshape(-1, robot.size))
