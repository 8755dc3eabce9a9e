"""From joints as they are written in a file to the moving links of a robot.

A file also holds fixed joints. They carry bodies but no motion, so each body is added to the
moving link that carries it, and the frames behind it are expressed from there. Bodies that are
carried by the base do not move and are left out.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

from pivident.robot.description import Joint, Link
from pivident.robot.frames import Pose
from pivident.robot.inertia import moved


@dataclass(frozen=True, eq=False)
class Member:
    """A joint and the body behind it, before fixed joints are merged.

    Attributes:
        joint: the joint; ``joint.parent`` counts members, -1 for the base.
        link: the body in the joint's frame.
        fixed: whether the joint does not move (then ``joint.kind`` means nothing).
    """

    joint: Joint
    link: Link
    fixed: bool = False


def merge_fixed(members: Sequence[Member]) -> tuple[tuple[Joint, ...], tuple[Link, ...]]:
    """Moving joints and their links, with fixed members merged into their carriers.

    Args:
        members: all joints, parents before children.

    Returns:
        joints and links of the same length; parents count moving joints.
    """
    joints: list[Joint] = []
    links: list[Link] = []
    carriers: list[int] = []  # moving joint that carries each member, -1 for the base
    poses: list[Pose] = []  # pose of each member's frame in its carrier's
    for member in members:
        joint = member.joint
        carrier, mounting = -1, Pose.identity()
        if joint.parent >= 0:
            carrier, mounting = carriers[joint.parent], poses[joint.parent]
        pose = mounting @ Pose(joint.rotation, joint.translation)
        if not member.fixed:
            joints.append(
                replace(joint, parent=carrier, rotation=pose.rotation, translation=pose.translation)
            )
            links.append(member.link)
            carriers.append(len(joints) - 1)
            poses.append(Pose.identity())
            continue
        carriers.append(carrier)
        poses.append(pose)
        if carrier >= 0:
            body = moved(member.link.inertia, pose.rotation, pose.translation)
            links[carrier] = replace(links[carrier], inertia=links[carrier].inertia + body)
    return tuple(joints), tuple(links)


def chosen_order(
    joints: Sequence[Joint], links: Sequence[Link], names: Iterable[str]
) -> tuple[tuple[Joint, ...], tuple[Link, ...]]:
    """The same tree with its joints in the order of ``names`` (parents are renumbered).

    Args:
        joints: moving joints.
        links: their links.
        names: every joint's name once.
    """
    present = {joint.name: i for i, joint in enumerate(joints)}
    order = [present[name] for name in names]
    place = {old: new for new, old in enumerate(order)} | {-1: -1}
    return (
        tuple(replace(joints[old], parent=place[joints[old].parent]) for old in order),
        tuple(links[old] for old in order),
    )


def tree_order(parents: Sequence[int]) -> list[int]:
    """Indices in depth-first order, children in the order in which they are written.

    Args:
        parents: index of each member's parent in the same list, -1 for the base.

    Returns:
        the indices that are reachable from the base: parents before children.
    """
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
