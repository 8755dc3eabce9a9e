"""From joints as they are written in a file to the moving links of a robot.

Fixed joints carry bodies but no motion: each such body is added to the moving link that carries
it, and the frames behind it are expressed in that link. Bodies carried by the base are left out.
What rounded angles left over in the frames of the moving joints is taken away, see `frames`.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pivident.robot.description import Joint, Link, Robot
from pivident.robot.frames import Pose, rotation_z, without_residues
from pivident.robot.inertia import moved


@dataclass(frozen=True, eq=False)
class Member:
    """A joint and the body behind it, before fixed joints are merged."""

    joint: Joint  # its ``parent`` counts members, -1 for the base
    link: Link  # the body in the joint's frame
    fixed: bool = False  # whether the joint does not move; ``joint.kind`` is then ignored


def carriers(members: Sequence[Member]) -> list[tuple[int, Pose]]:
    """Moving joint that carries each member (-1: the base), and the member's frame in its link."""
    found: list[tuple[int, Pose]] = []
    count = 0
    for member in members:
        joint = member.joint
        if not member.fixed:
            found.append((count, Pose.identity()))
            count += 1
            continue
        carrier, mounting = found[joint.parent] if joint.parent >= 0 else (-1, Pose.identity())
        found.append((carrier, mounting @ Pose(joint.rotation, joint.translation)))
    return found


def merge_fixed(members: Sequence[Member]) -> tuple[tuple[Joint, ...], tuple[Link, ...]]:
    """Moving joints (parents counted among them) and their links, fixed members merged in."""
    joints: list[Joint] = []
    links: list[Link] = []
    carried = carriers(members)
    for member, (carrier, pose) in zip(members, carried, strict=True):
        if not member.fixed:
            joint = member.joint
            parent, mounting = carried[joint.parent] if joint.parent >= 0 else (-1, Pose.identity())
            pose = mounting @ Pose(joint.rotation, joint.translation)
            joints.append(
                replace(joint, parent=parent, rotation=pose.rotation, translation=pose.translation)
            )
            links.append(member.link)
        elif carrier >= 0 and member.link.inertia.any():
            body = moved(member.link.inertia, pose.rotation, pose.translation)
            inertia = links[carrier].inertia + body
            links[carrier] = replace(links[carrier], inertia=inertia, is_body=True)
    return with_exact_frames(joints), tuple(links)


def with_exact_frames(joints: Sequence[Joint]) -> tuple[Joint, ...]:
    """Joints whose frames are free of what rounded angles left over."""
    size = max((float(np.abs(joint.translation).max()) for joint in joints), default=0.0)
    poses = [without_residues(Pose(j.rotation, j.translation), size) for j in joints]
    return tuple(
        replace(joint, rotation=pose.rotation, translation=pose.translation)
        for joint, pose in zip(joints, poses, strict=True)
    )


def chosen_order(
    joints: Sequence[Joint], links: Sequence[Link], names: Iterable[str]
) -> tuple[tuple[Joint, ...], tuple[Link, ...]]:
    """The same tree with its joints in the order of ``names`` (parents are renumbered)."""
    present = {joint.name: i for i, joint in enumerate(joints)}
    order = [present[name] for name in names]
    place = {old: new for new, old in enumerate(order)} | {-1: -1}
    return (
        tuple(replace(joints[old], parent=place[joints[old].parent]) for old in order),
        tuple(links[old] for old in order),
    )


def tree_order(parents: Sequence[int]) -> list[int]:
    """Indices reachable from the base (-1), depth first: parents before children, as written."""
    children: dict[int, list[int]] = {}
    for i, parent in enumerate(parents):
        children.setdefault(parent, []).append(i)
    order: list[int] = []
    stack = children.get(-1, [])[::-1]
    while stack:
        i = stack.pop()
        order.append(i)
        stack.extend(reversed(children.get(i, [])))
    return order


def link_frames(robot: Robot, q: np.ndarray) -> tuple[Pose, ...]:
    """Pose of every link's frame in the base frame; ``q``: of all joints of the tree [rad or m]."""
    frames: list[Pose] = []
    for joint, position in zip(robot.tree.joints, np.asarray(q, dtype=float), strict=True):
        own = Pose(joint.rotation, joint.translation)
        if joint.kind == "revolute":
            own = own @ Pose(rotation_z(position), np.zeros(3))
        else:
            own = own @ Pose(np.eye(3), np.array([0.0, 0.0, position]))
        frames.append(own if joint.parent < 0 else frames[joint.parent] @ own)
    return tuple(frames)
