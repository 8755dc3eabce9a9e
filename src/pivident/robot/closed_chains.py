"""From joints as a file has them, and what closes their loops, to a robot of independent joints.

The equations of a closure with the frames (p_1, R_1) and (p_2, R_2), seen from the base, are

    R_1ᵀ (p_1 - p_2) = 0,    a_1 · b_2 = 0

for pairs of axes a of the first and b of the second frame, see `constraints.DIRECTIONS`. Of a
planar loop that is described in space some follow from the others, and in the first frame they are
the same ones whichever way the mechanism turns. Those to keep are found by QR with pivots over
several postures. The compiled loops of ``dynamics`` have equations of their own; these here are for
the description, and test those.

Joints that follow others in proportion, without loops of links.

Where only linear constraints R q = r close a mechanism, with the independent joints q_a and the
others q_d,

    q = N q_a + q_0,    N_d = -R_d⁺ R_a,    q_0d = R_d⁺ r

are the same at every posture.

From joints as they are written in a file to the moving links of a robot.

Fixed joints carry bodies but no motion: each such body is added to the moving link that carries
it, and the frames behind it are expressed in that link. Bodies carried by the base are left out.
What rounded angles left over in the frames of the moving joints is taken away, see `frames`.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pivident.foundation.errors import RobotDescriptionError
from pivident.robot.constraints import DIRECTIONS, Closure, Constraints, LinearConstraint
from pivident.robot.description import Joint, Link, Robot
from pivident.robot.frames import Pose, rotation_z, without_residues
from pivident.robot.inertia import moved
from pivident.robot.naming import find_joint
from pivident.robot.transmission import Transmission

#: Largest gap of a closed loop [m, rad].
CLOSED = 1e-10
#: The same of one that was stored.
STORED = 1e-6
#: Relative size of a singular value that counts as zero.
RANK = 1e-7
#: Postures from which the rank of the equations is seen, and how far they are apart [rad or m].
POSTURES, SPREAD = 6, 0.05
MAX_STEPS = 60
#: Ratios below this share of the largest are rounding.
ROUNDING = 1e-12


def closed_robot(
    tree: Robot,
    independent: Sequence[str],
    closures: Sequence[Closure] = (),
    linear: Sequence[LinearConstraint] = (),
    posture: np.ndarray | None = None,
    driven: Sequence[str] = (),
) -> Robot:
    """The robot of a tree whose loops are closed: its joints are the independent ones.

    Args:
        tree: all joints and links, loops cut. Its drives and couplings are left out; give those of
            the independent joints to `pivident.robot.with_drives` afterwards.
        independent: names of the joints that have motors and encoders, or are chosen to describe
            the posture.
        closures: frames that meet where the loops were cut.
        linear: joints that move in proportion.
        posture: positions near which the loops close, shape (tree joints,); None: zeros.
        driven: further joints that have motors, whose torques are measured.

    Returns:
        The robot; its links are those of the independent joints, `Robot.tree` has all.

    Raises:
        RobotDescriptionError: an unknown joint; loops that do not close, by how much; joints that
            nothing determines; independent joints that the loops determine.
    """
    places = tuple(find_joint(tree.joint_names, name) for name in independent)
    if len(set(places)) != len(places) or not places:
        raise RobotDescriptionError(
            f"independent joints are {', '.join(independent) or 'missing'}", advice="name each once"
        )
    start = np.zeros(tree.size) if posture is None else np.asarray(posture, dtype=float)
    motors = tuple(find_joint(tree.joint_names, name) for name in driven)
    constraints = Constraints(places, tuple(closures), tuple(linear), start, driven=motors)
    others = [i for i in range(tree.size) if i not in places]
    start = assembled(tree, constraints, start)
    kept = _independent_equations(tree, replace(constraints, posture=start), others)
    constraints = replace(constraints, posture=start, kept=kept)
    return replace(
        tree,
        joints=tuple(tree.joints[i] for i in places),
        links=tuple(tree.links[i] for i in places),
        rotor_inertia=tree.rotor_inertia[list(places)],
        transmission=Transmission.direct(len(places)),
        couplings=(),
        passive_joints=tuple(tree.joints[i] for i in others),
        passive_links=tuple(tree.links[i] for i in others),
        constraints=constraints,
    )


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


def equations(tree: Robot, constraints: Constraints, q: np.ndarray) -> tuple[np.ndarray, ...]:
    """All equations c(q), shape (equations,), and A = ∂c/∂q, shape (equations, tree joints)."""
    poses = link_frames(tree, q)
    values: list[float] = []
    rows: list[np.ndarray] = []
    for closure in constraints.closures:
        ends = [
            poses[link] @ frame if link >= 0 else frame
            for link, frame in zip(closure.links, closure.frames, strict=True)
        ]
        speeds, turns, point = [], [], ends[1].translation
        for link in closure.links:
            speed, turn = np.zeros((3, tree.size)), np.zeros((3, tree.size))
            for k in tree.ancestors(link) if link >= 0 else ():
                axis = poses[k].rotation[:, 2]
                if tree.joints[k].kind == "prismatic":
                    speed[:, k] = axis
                else:
                    speed[:, k] = np.cross(axis, point - poses[k].translation)
                    turn[:, k] = axis
            speeds.append(speed)
            turns.append(turn)
        seen = ends[0].rotation.T  # which turns with the first link: its end counts where p_2 is
        values.extend(seen @ (ends[0].translation - point))
        rows.extend(seen @ (speeds[0] - speeds[1]))
        for first, second in DIRECTIONS[closure.kind]:
            a, b = ends[0].rotation[:, first], ends[1].rotation[:, second]
            values.append(float(a @ b))
            rows.append(np.cross(a, b) @ (turns[0] - turns[1]))
    for one in constraints.linear:
        values.append(float(one.ratios @ q - one.offset))
        rows.append(one.ratios)
    return np.array(values), np.array(rows).reshape(-1, tree.size)


def assembled(tree: Robot, constraints: Constraints, q: np.ndarray) -> np.ndarray:
    """The posture near ``q``, its independent joints as they are, in which all loops close.

    Newton's method with steps of least squares, halved while they lead away.

    Raises:
        RobotDescriptionError: names the loop that stays open most, and by how much.
    """
    q = np.array(q, dtype=float)
    if q.shape != (tree.size,):
        raise RobotDescriptionError(
            f"a posture has {tree.size} positions, one for each joint",
            advice=f"shape {q.shape} was given",
        )
    others = [i for i in range(tree.size) if i not in constraints.places]
    value, slope = equations(tree, constraints, q)
    for _ in range(MAX_STEPS):
        if np.abs(value).max(initial=0.0) < CLOSED / 1e3:
            break
        step = np.zeros(tree.size)
        step[others] = np.linalg.lstsq(slope[:, others], -value, rcond=1e-12)[0]
        share = 1.0
        tried, fresh = equations(tree, constraints, q + step)
        while np.linalg.norm(tried) > np.linalg.norm(value) and share > 1e-3:
            share /= 2.0
            tried, fresh = equations(tree, constraints, q + share * step)
        if not np.linalg.norm(tried) < np.linalg.norm(value):
            break
        q, value, slope = q + share * step, tried, fresh
    if np.abs(value).max(initial=0.0) > CLOSED:
        gap, is_loop = _largest_gap(tree, constraints, value)
        what = "its frames, the lengths of the links" if is_loop else "its ratios, its offset"
        moved = ", ".join(tree.joints[i].name for i in others) or "none"
        raise RobotDescriptionError(
            f"{gap}",
            advice=f"check {what} and the posture to start from, in which only passive joints may "
            f"move ({moved})",
        )
    return q


def check_closed(tree: Robot, constraints: Constraints) -> None:
    """Refuse a posture of the description in which the loops are open.

    Raises:
        RobotDescriptionError: names the loop that is open most, and by how much.
    """
    value = equations(tree, constraints, constraints.posture)[0]
    if not np.abs(value).max(initial=0.0) < STORED:
        gap, _ = _largest_gap(tree, constraints, value)
        raise RobotDescriptionError(
            f"robot {tree.name!r}: {gap}, in the posture that it was stored with",
            advice="write the file again",
        )


def _largest_gap(tree: Robot, constraints: Constraints, value: np.ndarray) -> tuple[str, bool]:
    """What is open most, and how far it is; and whether that is a loop."""
    gaps: list[tuple[float, str, bool]] = []
    first = 0
    for closure in constraints.closures:
        own = value[first : first + closure.equations]
        apart, turned = np.linalg.norm(own[:3]), np.abs(own[3:]).max(initial=0.0)
        text = (
            f"its axes are {np.degrees(np.arcsin(min(turned, 1.0))):.3g}° off"
            if apart <= CLOSED
            else f"its ends are {apart:.3g} m apart"
        )
        size = float(max(apart, turned))
        gaps.append((size, f"loop {closure.name!r} does not close: {text}", True))
        first += closure.equations
    for one, left in zip(constraints.linear, value[first:], strict=True):
        joint = tree.joints[int(np.argmax(np.abs(one.ratios)))]
        size = float(abs(left) / np.abs(one.ratios).max())
        text = f"joint {joint.name!r} is {size:.3g} {joint.position_unit} off"
        gaps.append((size, f"gear {one.name!r} does not hold: {text}", False))
    _, text, is_loop = max(gaps)
    return text, is_loop


def _independent_equations(
    tree: Robot, constraints: Constraints, others: list[int]
) -> tuple[int, ...]:
    """Equations that do not follow from the others, one for each dependent joint."""
    rng = np.random.default_rng(19730501)
    slopes = [equations(tree, constraints, constraints.posture)[1]]
    _check_rank(tree, slopes[0], others)
    for k in range(2 * POSTURES):
        # near the end of a loop's reach only small steps close it
        spread = SPREAD if k < POSTURES else 0.01 * SPREAD
        q = constraints.posture.copy()
        q[list(constraints.places)] += rng.uniform(-spread, spread, len(constraints.places))
        try:
            q = assembled(tree, constraints, q)
        except RobotDescriptionError:
            continue
        slopes.append(equations(tree, constraints, q)[1])
    if len(slopes) == 1:
        raise RobotDescriptionError(
            f"robot {tree.name!r} cannot move: its loops hold "
            f"{', '.join(tree.joints[i].name for i in constraints.places)}",
            advice="name fewer independent joints, or free a joint of the loop",
        )
    side = np.hstack([slope[:, others] for slope in slopes])
    import scipy.linalg

    _, size, pivots = scipy.linalg.qr(side.T, mode="economic", pivoting=True)
    count = len(others)
    left = np.abs(np.diag(size))[count:]
    if left.size and left.max() > RANK * abs(size[0, 0]):
        raise RobotDescriptionError(
            f"robot {tree.name!r} has loops with more than {count} independent equations for "
            f"{count} passive joints",
            advice="name fewer independent joints, or free a joint of a loop",
        )
    return tuple(sorted(int(k) for k in pivots[:count]))


def _check_rank(tree: Robot, slope: np.ndarray, others: list[int]) -> None:
    """Refuse joints that no equation determines."""
    own = slope[:, others]
    *_, directions = np.linalg.svd(own)
    sizes = np.linalg.svd(own, compute_uv=False)
    rank = int((sizes > RANK * sizes.max(initial=1.0)).sum())
    if rank == len(others):
        return
    free = np.abs(directions[rank:]).max(axis=0)
    names = ", ".join(tree.joints[others[k]].name for k in np.flatnonzero(free > 1e-3))
    raise RobotDescriptionError(
        f"robot {tree.name!r}: nothing determines {names} at the posture where its loops are "
        "closed",
        advice="add a loop or an independent joint, or start from a posture that is not singular",
    )


def proportions(robot: Robot) -> tuple[np.ndarray, np.ndarray] | None:
    """N, shape (tree joints, joints), and q_0 [rad or m], shape (tree joints,).

    None where loops of links move joints.
    """
    constraints, count = robot.constraints, robot.tree.size
    if constraints is None:
        return np.eye(count), np.zeros(count)
    if constraints.closures:
        return None
    own = list(constraints.places)
    others = [i for i in range(count) if i not in own]
    rows = np.array([one.ratios for one in constraints.linear])
    offsets = np.array([one.offset for one in constraints.linear])
    scale = np.abs(rows).max(axis=1)
    rows, offsets = rows / scale[:, None], offsets / scale
    right = np.column_stack([-rows[:, own], offsets])
    solved = np.linalg.lstsq(rows[:, others], right, rcond=None)[0]
    solved[np.abs(solved) < ROUNDING * np.abs(solved).max(axis=0, initial=0.0)] = 0.0
    gain, rest = np.zeros((count, len(own))), np.zeros(count)
    gain[own] = np.eye(len(own))
    gain[others], rest[others] = solved[:, :-1], solved[:, -1]
    return gain, rest
