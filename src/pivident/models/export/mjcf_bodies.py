"""Bodies of an MJCF: what moves together, in the posture in which the loops are closed.

MuJoCo starts where the file draws the bodies. So a mechanism with loops is drawn at the posture
q* of its description, its joints with ``ref`` = q*. Joints of a body act one after the other: a
frame that is no body, between the axes of a universal joint, is a further joint of the body that
hangs on it. With P_1 … P_m the frames of these joints at q*, each in the one before, the body's
pose is P_1 … P_m, and joint k has its place at (P_{k+1} … P_m)⁻¹.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pivident.models.export.joint_side import JointSide
from pivident.models.export.xml_edit import Stick, number, numbers, quoted, sticks
from pivident.models.runnable_model import RunnableModel, written_body
from pivident.robot.description import Joint, Robot
from pivident.robot.frames import Pose, rotation_z

#: Mass and moments of frames that MuJoCo needs a body for, well above its least ones [kg, kg m²].
ALMOST_NOTHING = 1e-12


@dataclass(frozen=True, eq=False)
class DrawnBody:
    """Joints that act one after the other, and the link behind the last."""

    joints: tuple[int, ...]  # in the tree; the last one's link is the body
    pose: Pose  # in the body that carries it
    places: tuple[Pose, ...]  # of each joint's frame in the body

    @property
    def link(self) -> int:
        """Index of the link in the tree."""
        return self.joints[-1]


def drawn_bodies(robot: Robot) -> dict[int, list[DrawnBody]]:
    """Bodies by the link that carries them, -1 for the base."""
    tree, constraints = robot.tree, robot.constraints
    ends = {i for c in constraints.closures for i in c.links} if constraints else set()
    children: dict[int, list[int]] = {i: [] for i in range(-1, tree.size)}
    for i, joint in enumerate(tree.joints):
        children[joint.parent].append(i)
    found: dict[int, list[DrawnBody]] = {}
    for parent in children:
        if parent >= 0 and _is_between(tree, parent, children, ends):
            continue
        for i in children[parent]:
            group = [i]
            while _is_between(tree, group[-1], children, ends):
                group += children[group[-1]]
            found.setdefault(parent, []).append(_drawn(robot, tuple(group)))
    return found


def _is_between(tree: Robot, i: int, children: dict[int, list[int]], ends: set[int]) -> bool:
    """Whether a link is only a frame between two joints."""
    return not tree.links[i].is_body and len(children[i]) == 1 and i not in ends


def _drawn(robot: Robot, joints: tuple[int, ...]) -> DrawnBody:
    frames = [_frame(robot, i) for i in joints]
    pose, places = frames[0], [Pose.identity()]
    for frame in frames[1:]:
        pose = pose @ frame
    for frame in reversed(frames[1:]):
        places.insert(0, places[0] @ Pose(frame.rotation.T, -frame.rotation.T @ frame.translation))
    return DrawnBody(joints, pose, tuple(places))


def _frame(robot: Robot, i: int) -> Pose:
    """The frame of a link in the one that carries it, as drawn."""
    joint = robot.tree.joints[i]
    mounted = Pose(joint.rotation, joint.translation)
    if robot.constraints is None:
        return mounted
    at = float(robot.constraints.posture[i])
    if joint.kind == "prismatic":
        return mounted @ Pose(np.eye(3), np.array([0.0, 0.0, at]))
    return mounted @ Pose(rotation_z(at), np.zeros(3))


def body_lines(
    model: RunnableModel,
    side: JointSide,
    names: tuple[str, ...],
    bodies: dict[int, list[DrawnBody]],
    sites: dict[int, list[str]],
    parent: int = -1,
) -> list[str]:
    """Bodies on a link, with all that they carry inside."""
    lines: list[str] = []
    for drawn in bodies.get(parent, []):
        i = drawn.link
        pose = f'pos="{numbers(drawn.pose.translation)}" '
        pose += f'quat="{numbers(quaternion(drawn.pose.rotation))}"'
        lines += [f"<body name={quoted(names[i])} {pose}>", f"  {_inertial(model, names, i)}"]
        lines += [
            f"  {_joint(model.robot, side, k, place)}"
            for k, place in zip(drawn.joints, drawn.places, strict=True)
        ]
        lines += [f"  {geom(stick)}" for stick in sticks(model)[i]]
        lines += [f"  {site}" for site in sites.get(i, [])]
        inside = body_lines(model, side, names, bodies, sites, i)
        lines += [*(f"  {line}" for line in inside), "</body>"]
    return lines


def _inertial(model: RunnableModel, names: tuple[str, ...], i: int) -> str:
    if not model.robot.tree.links[i].is_body:
        least = number(ALMOST_NOTHING)
        return f'<inertial pos="0 0 0" mass="{least}" diaginertia="{least} {least} {least}"/>'
    body = written_body(names[i], model.inertial(i))
    # MuJoCo diagonalises a fullinertia itself, before its version 4 to seven digits only
    moments, axes = body.principal
    return (
        f'<inertial pos="{numbers(body.center_of_mass)}" mass="{number(body.mass)}" '
        f'diaginertia="{numbers(moments)}" quat="{numbers(quaternion(axes))}"/>'
    )


def _joint(robot: Robot, side: JointSide, i: int, place: Pose) -> str:
    joint: Joint = robot.tree.joints[i]
    kind = "hinge" if joint.kind == "revolute" else "slide"
    where = f'axis="{numbers(place.rotation[:, 2])}"'
    if place.translation.any():
        where = f'pos="{numbers(place.translation)}" {where}'
    if robot.constraints is not None:
        where += f' ref="{number(robot.constraints.posture[i])}"'
    limits = "" if joint.position_limits is None else f' range="{numbers(joint.position_limits)}"'
    values = {
        "armature": side.armature[i],
        "damping": side.damping[i],
        "frictionloss": side.dry_friction[i],
        "stiffness": side.stiffness[i],
    }
    written = "".join(f' {key}="{number(value)}"' for key, value in values.items() if value)
    return f'<joint name={quoted(joint.name)} type="{kind}" {where}{limits}{written}/>'


def geom(stick: Stick) -> str:
    """A stick as a capsule."""
    ends = numbers((*stick.start, *stick.end))
    return f'<geom type="capsule" fromto="{ends}" size="{number(stick.radius)}"/>'


def quaternion(rotation: np.ndarray) -> np.ndarray:
    """Unit quaternion w x y z of a rotation, the largest element first (Shepperd 1978)."""
    r, trace = rotation, np.trace(rotation)
    # 4 q qᵀ, of which the row with the largest diagonal element has the most digits
    outer = np.array(
        [
            [1.0 + trace, r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]],
            [0.0, 1.0 + 2.0 * r[0, 0] - trace, r[0, 1] + r[1, 0], r[0, 2] + r[2, 0]],
            [0.0, 0.0, 1.0 + 2.0 * r[1, 1] - trace, r[1, 2] + r[2, 1]],
            [0.0, 0.0, 0.0, 1.0 + 2.0 * r[2, 2] - trace],
        ]
    )
    outer += np.triu(outer, 1).T
    row = outer[int(np.argmax(np.diag(outer)))]
    return row / np.linalg.norm(row)
