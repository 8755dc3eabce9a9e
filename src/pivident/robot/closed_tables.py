"""Loops and gears of a modified DH file: from its tables to a closed robot."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from pivident.foundation.errors import RobotDescriptionError
from pivident.robot.closed_chains import closed_robot
from pivident.robot.constraints import Closure, LinearConstraint
from pivident.robot.description import Robot
from pivident.robot.frames import Pose, exact_angle, rotation_from_rpy
from pivident.robot.naming import find_joint, nearest

if TYPE_CHECKING:
    from pivident.robot.mdh_keys import EndEntry, GearEntry, JointEntry, LoopEntry

#: Name of the fixed base as the end of a loop.
BASE = "base"


def closed_from_tables(
    tree: Robot,
    rows: Sequence[JointEntry],
    loops: Sequence[LoopEntry],
    gears: Sequence[GearEntry],
    radians: float,
) -> Robot:
    """The robot of a tree, its rows, loops and gears.

    Args:
        tree: all joints, without drives.
        rows: its moving joints as the file has them.
        loops: frames that meet.
        gears: joints that move in proportion.
        radians: per unit of angle in the file.

    Raises:
        RobotDescriptionError: names the loop or gear, the key and the value.
    """
    independent = [row.name for row in rows if not row.passive]
    if not loops and not gears:
        passive = next(row.name for row in rows if row.passive)
        raise RobotDescriptionError(
            f"joint {passive!r} is passive, but nothing moves it",
            advice="add the [[loops]] or [[gears]] that do",
        )
    if len(independent) == len(rows):
        raise RobotDescriptionError(
            "there are [[loops]] or [[gears]], but no joint is passive",
            advice="write passive = true at those without a motor",
        )
    names = [loop.name for loop in loops] + [gear.name for gear in gears]
    if len(set(names)) != len(names):
        raise RobotDescriptionError(
            f"names of loops and gears: {', '.join(names)}", advice="each once"
        )
    units = [radians if joint.kind == "revolute" else 1.0 for joint in tree.joints]
    return closed_robot(
        tree,
        independent,
        [_closure(tree, entry, radians) for entry in loops],
        [_gear(tree, entry, units) for entry in gears],
        np.array([unit * row.posture for unit, row in zip(units, rows, strict=True)]),
    )


def _closure(tree: Robot, entry: LoopEntry, radians: float) -> Closure:
    """Two frames that meet."""
    ends = [
        (_link(tree, f"loop {entry.name!r}: key {key!r}", end.link), _frame(end, radians))
        for key, end in (("first", entry.first), ("second", entry.second))
    ]
    (first, one), (second, other) = ends
    if first == second:
        raise RobotDescriptionError(
            f"loop {entry.name!r}: both ends are in {entry.first.link!r}", advice="name two links"
        )
    return Closure(entry.name, (first, second), (one, other), entry.closes)


def _link(tree: Robot, where: str, name: str) -> int:
    """Index of a link by its name or that of its joint, -1 for the base."""
    if name == BASE:
        return -1
    try:
        return tree.link_index(name)
    except RobotDescriptionError:
        known = [BASE, *(link.name for link in tree.links), *tree.joint_names]
        raise RobotDescriptionError(
            f"{where}: there is no moving link {name!r}", advice=nearest(name, dict.fromkeys(known))
        ) from None


def _frame(end: EndEntry, radians: float) -> Pose:
    roll, pitch, yaw = (exact_angle(x) if radians == 1.0 else radians * x for x in end.rpy)
    return Pose(rotation_from_rpy(roll, pitch, yaw), np.array(end.at, dtype=float))


def _gear(tree: Robot, entry: GearEntry, units: Sequence[float]) -> LinearConstraint:
    """Σ ratio q = offset, all in SI."""
    ratios = np.zeros(tree.size)
    for name, ratio in entry.ratios.items():
        try:
            i = find_joint(tree.joint_names, name)
        except RobotDescriptionError as error:
            raise RobotDescriptionError.of_part(f"gear {entry.name!r}: ", error) from None
        ratios[i] = ratio / units[i]  # of a position in the units of the file
    return LinearConstraint(entry.name, ratios, entry.offset)
