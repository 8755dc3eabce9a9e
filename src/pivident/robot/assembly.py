"""From joints as they are written in a file to the moving links of a robot.

Fixed joints carry bodies but no motion: each such body is added to the moving link that carries
it, and the frames behind it are expressed in that link. Bodies carried by the base are left out.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

from pivident.robot.description import Joint, Link
from pivident.robot.frames import Pose
from pivident.robot.inertia import moved


@dataclass(frozen=True, eq=False)
class Member:
    """A joint and the body behind it, before fixed joints are merged."""

    joint: Joint  # its ``parent`` counts members, -1 for the base
    link: Link  # the body in the joint's frame
    fixed: bool = False  # whether the joint does not move; ``joint.kind`` is then ignored


def merge_fixed(members: Sequence[Member]) -> tuple[tuple[Joint, ...], tuple[Link, ...]]:
    """Moving joints (parents counted among them) and their links, fixed members merged in."""
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
