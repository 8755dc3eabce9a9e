"""The robot that a log is held against: its joints before it is known which of them matter."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from pivident.errors import RobotDescriptionError
from pivident.init.assumption import DraftError
from pivident.robot.description import Robot
from pivident.robot.gallery import gallery_names, load_robot
from pivident.robot.mjcf import movable_joints, read_mjcf
from pivident.robot.naming import MJCF_FILES, URDF_FILES, errors_name
from pivident.robot.urdf import read_urdf
from pivident.robot.urdf_xml import MOVING, UrdfJoint, file_content, parse_model


@dataclass(frozen=True, eq=False)
class RobotFile:
    """A robot's file, or a robot of the gallery."""

    name: str  # path or name in the gallery
    is_tree: bool  # a URDF or MJCF: joints can be chosen and frozen
    joint_names: tuple[str, ...]  # joints that can be identified, parents first
    fixed: tuple[str, ...] = ()  # joints that move but have no column (they mimic, float, follow …)
    found: bool = False  # whether nobody named it

    def robot(
        self, joints: Sequence[str] | None = None, frozen: Mapping[str, float] | None = None
    ) -> Robot:
        """The robot with some of its joints; frozen [rad or m]."""
        if not self.is_tree:
            return load_robot(self.name)
        read = read_mjcf if self.name.endswith(MJCF_FILES) else read_urdf
        return read(self.name, joints=joints or self.joint_names, frozen=frozen)


def robot_file(name: str | None, logs: Sequence[Path]) -> RobotFile:
    """The robot by its name, or the only robot file beside the logs."""
    found = name is None
    name = name or _beside(logs)
    if name.endswith((".xacro", ".xacro.gz")):
        raise DraftError(
            f"{name} is a xacro, which has to be expanded first: xacro {name} > robot.urdf"
        )
    if name.endswith(MJCF_FILES):
        movable_names, others = movable_joints(name)
        return RobotFile(name, True, movable_names, others, found)
    if not name.endswith(URDF_FILES):
        robot = load_robot(name)
        return RobotFile(name, False, robot.joint_names, found=found)
    with errors_name(name):
        model = parse_model(file_content(Path(name)))
        movable = [joint for joint in model.joints if joint.type != "fixed"]
        usable = [joint for joint in movable if _can_be_kept(joint)]
        if not usable:
            raise RobotDescriptionError("no joint of it can move", advice="is it the right file?")
    carrier = {joint.child: joint for joint in model.joints}
    order = sorted(usable, key=lambda joint: _depth(joint, carrier))
    names = tuple(joint.name for joint in order)
    return RobotFile(
        name, True, names, tuple(j.name for j in movable if j.name not in names), found
    )


def _can_be_kept(joint: UrdfJoint) -> bool:
    """Whether a joint is one independent degree of freedom with room to move."""
    room = joint.limits is None or joint.limits[0] < joint.limits[1]
    return joint.type in MOVING and joint.mimics is None and room


def _depth(joint: UrdfJoint, carrier: Mapping[str, UrdfJoint]) -> int:
    """Number of joints between a joint and the root; a ring ends the count."""
    depth = 0
    while joint.parent in carrier and depth <= len(carrier):
        joint, depth = carrier[joint.parent], depth + 1
    return depth


def _beside(logs: Sequence[Path]) -> str:
    """The only URDF in the folder of the logs."""
    folder = logs[0].absolute().parent
    found = sorted(p for p in folder.iterdir() if p.name.endswith(URDF_FILES) and p.is_file())
    if len(found) == 1:
        return str(logs[0].parent / found[0].name)
    several = ", ".join(p.name for p in found)
    what = f"several URDF files lie beside it ({several})" if found else "no URDF lies beside it"
    raise DraftError(
        f"the robot of {logs[0].name} is not named, and {what}",
        advice=f"name one with --robot FILE, or one of the gallery: {', '.join(gallery_names())}",
    )
