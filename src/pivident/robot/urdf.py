"""URDF → Robot: trees of revolute, continuous, prismatic and fixed joints.

**Frame rule.** A URDF joint may turn about any axis a of its frame, whereas here a link's frame
has its joint's axis as z. So each moving link gets a frame of its own: the URDF link frame turned
by A, the *smallest* rotation that takes z to the axis (about z × a; the half turn about x where
a = -z; no turn where a = z). The origin stays. A link's inertial parameters are printed in that
frame: ``mx`` of a link that turns about its URDF y axis lies along A · x = x, ``my`` along
A · y = -z and ``mz`` along A · z = y.

The base frame is the frame of the root link, whose own inertia does not enter. Bodies behind fixed
and frozen joints are added to the moving link that carries them.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from pivident.foundation.errors import RobotDescriptionError, concerning
from pivident.robot.closed_chains import Member, chosen_order, closed_robot, merge_fixed, tree_order
from pivident.robot.constraints import LinearConstraint
from pivident.robot.description import STANDARD_GRAVITY, Joint, Link, Robot, UrdfFile
from pivident.robot.frames import Pose, rotation_about, rotation_from_z_to
from pivident.robot.friction import DEFAULT_FRICTION, FrictionLaw
from pivident.robot.inertia import moved
from pivident.robot.naming import errors_name, frozen_example, nearest, repeated
from pivident.robot.transmission import Transmission
from pivident.robot.urdf_xml import MOVING, UrdfJoint, UrdfModel, file_content, parse_model

DOWN = (0.0, 0.0, -STANDARD_GRAVITY)


def read_urdf(
    path: str | Path,
    *,
    joints: Sequence[str] | None = None,
    frozen: Mapping[str, float] | None = None,
    gravity: Sequence[float] = DOWN,
    friction: FrictionLaw = DEFAULT_FRICTION,
) -> Robot:
    """Read a robot from a URDF, gzip or not.

    Position limits, rated speeds and torque limits come from ``<limit>`` (a velocity or effort of
    zero counts as unknown, and so does a range from zero to zero), nominal ``fv`` and ``fc`` from
    ``<dynamics>``. Drives are unknown to a URDF; add them with `pivident.robot.with_drives`. Joints
    that mimic others have no motor: they move in proportion, and are no joints of the robot, but of
    its `Robot.tree`.

    Args:
        path: the file.
        joints: names of the joints to keep, in the order of the log's columns; default all, depth
            first in the order of the file. The others are frozen, but those that mimic one that is
            kept.
        frozen: position at which a joint is frozen [rad or m], by name; joints that are not kept
            and not named here are frozen at zero, those that mimic a frozen one where that holds
            them.
        gravity: acceleration of gravity in the root link's frame [m/s²], shape (3,).
        friction: friction law of all joints; open slopes follow from the rated speeds.

    Returns:
        The robot.

    Raises:
        RobotDescriptionError: the file cannot be read or used; names element, value, next step.
    """
    with errors_name(str(path)):
        content = file_content(Path(path))
    robot = parse_urdf(
        content,
        joints=joints,
        frozen=frozen,
        gravity=gravity,
        friction=friction,
        source=str(path),
    )
    assert robot.urdf is not None
    return replace(robot, urdf=replace(robot.urdf, path=str(Path(path).absolute())))


def parse_urdf(
    content: bytes | str,
    *,
    joints: Sequence[str] | None = None,
    frozen: Mapping[str, float] | None = None,
    gravity: Sequence[float] = DOWN,
    friction: FrictionLaw = DEFAULT_FRICTION,
    source: str = "URDF",
) -> Robot:
    """Build a robot from the text of a URDF; arguments as for `read_urdf`.

    Args:
        content: text of the file.
        joints: names of the joints to keep, in order.
        frozen: positions of frozen joints by name [rad or m].
        gravity: acceleration of gravity in the root link's frame [m/s²], shape (3,).
        friction: friction law of all joints.
        source: what errors call the file.

    Returns:
        The robot.

    Raises:
        RobotDescriptionError: it cannot be used; names element, value, next step.
    """
    with errors_name(source):
        model = parse_model(content)
        positions = _frozen_positions(model, joints, frozen or {})
        moving, links = merge_fixed(_members(model, positions, friction))
        order = list(joints or ())
        if len(order) == len(moving):
            moving, links = chosen_order(moving, links, order)
            _check_parents_first(moving)
        robot = Robot(
            name=model.name,
            joints=moving,
            links=links,
            gravity=np.array(gravity, dtype=float),
            rotor_inertia=np.zeros(len(moving)),
            transmission=Transmission.direct(len(moving)),
            description=source,
            urdf=UrdfFile("", text_digest(content), positions),
        )
        robot = _with_followers(robot, model, order)
        return replace(robot, friction_nominal=_nominal_friction(robot, model))


def _with_followers(tree: Robot, model: UrdfModel, order: Sequence[str]) -> Robot:
    """The robot without the joints that mimic others: they move in proportion, without motors.

    Its joints are in the given order, else in that of the tree.
    """
    followers = {j.name: j for j in model.joints if j.mimics and j.name in tree.joint_names}
    if not followers:
        return tree
    rules: list[LinearConstraint] = []
    for i, name in enumerate(tree.joint_names):
        if name in followers:
            joint = followers[name]
            ratios = np.zeros(tree.size)
            ratios[i], ratios[tree.joint_names.index(str(joint.mimics))] = 1.0, -joint.multiplier
            rules.append(LinearConstraint(name, ratios, joint.offset))
    tree = tree.with_friction(dict.fromkeys(followers, FrictionLaw(())))
    names = [name for name in order if name in tree.joint_names] or tree.joint_names
    leaders = [name for name in names if name not in followers]
    return closed_robot(tree, leaders, linear=rules)


def link_places(content: bytes | str, robot: Robot) -> dict[str, tuple[int, Pose]]:
    """Where the links of a URDF are in the robot that was read from it.

    Args:
        content: text of the file.
        robot: the robot; its joints are those that move, all others are fixed or frozen.

    Returns:
        For each link of the file the index of the moving link that carries it (-1: the base), and
        the pose of its URDF frame in that link's frame, by the frame rule.

    Raises:
        RobotDescriptionError: the file cannot be used, or a joint of the robot is not in it.
    """
    model = parse_model(content)
    order, _ = _tree(model)
    robot = robot.tree
    missing = set(robot.joint_names) - {joint.name for joint in model.joints}
    if missing:
        raise RobotDescriptionError(
            f"has no joint {', '.join(map(repr, sorted(missing)))} of robot {robot.name!r}",
            advice="give the file that the robot was read from",
        )
    frozen = {} if robot.urdf is None else robot.urdf.frozen
    children = {joint.child for joint in model.joints}
    places = {name: (-1, Pose.identity()) for name in model.links if name not in children}
    for joint in (model.joints[i] for i in order):
        if joint.name in robot.joint_names:
            back = Pose(rotation_from_z_to(joint.axis).T, np.zeros(3))
            places[joint.child] = robot.joint_names.index(joint.name), back
        else:
            carrier, pose = places[joint.parent]
            moved_by = joint_motion(joint, frozen.get(joint.name, 0.0))
            places[joint.child] = carrier, pose @ joint.origin @ moved_by
    return places


def text_digest(content: bytes | str) -> str:
    """SHA-256 of the unpacked text of a URDF, as kept in `UrdfFile`."""
    text = content.encode("utf-8", "surrogatepass") if isinstance(content, str) else content
    return hashlib.sha256(text).hexdigest()


def _frozen_positions(
    model: UrdfModel, kept: Sequence[str] | None, frozen: Mapping[str, float]
) -> dict[str, float]:
    """Position of every joint that could move and does not."""
    movable = [joint.name for joint in model.joints if joint.type != "fixed"]
    for key, names in (("joints", kept or ()), ("frozen", frozen)):
        for name in names:
            if name not in movable:
                raise RobotDescriptionError(
                    f"{key}: there is no moving joint {name!r}", advice=nearest(name, movable)
                ).about(key, *((name,) if key == "frozen" else ()))
    if kept is not None:
        both = sorted(set(kept) & set(frozen))
        if both or repeated(list(kept)):
            raise RobotDescriptionError(
                f"joints: {', '.join(both or repeated(list(kept)))} cannot be kept "
                f"{'and frozen' if both else 'twice'}",
                advice="name each joint once",
            ).about("joints")
    moving = None if kept is None else {*kept, *_moved_along(model, kept, frozen)}
    positions = {
        name: float(frozen.get(name, 0.0))
        for name in movable
        if name in frozen or (moving is not None and name not in moving)
    }
    for _ in model.joints:  # followers of followers
        positions |= {
            joint.name: joint.multiplier * positions[joint.mimics] + joint.offset
            for joint in model.joints
            if joint.mimics in positions and joint.name not in frozen
        }
    for joint in model.joints:
        if joint.name in positions:
            with concerning("frozen", joint.name):
                _check_frozen(joint, positions[joint.name])
        elif joint.type != "fixed":
            _check_kept(joint, [name for name in movable if name not in positions])
    return positions


def _moved_along(model: UrdfModel, kept: Sequence[str], frozen: Mapping[str, float]) -> list[str]:
    """Joints that mimic one that is kept, and that are not named as frozen."""
    found = list(kept)
    for _ in model.joints:  # followers of followers
        found += [
            joint.name
            for joint in model.joints
            if joint.mimics in found and joint.name not in found and joint.name not in frozen
        ]
    return [name for name in found if name not in kept]


def _check_kept(joint: UrdfJoint, kept: Sequence[str]) -> None:
    """Refuse joints that are not one degree of freedom with room to move, or that follow none."""
    where = f"joint {joint.name!r}"
    freeze = f"freeze it, {frozen_example(joint.name)}, or leave it out of `joints`"
    if joint.type not in MOVING:
        raise RobotDescriptionError(f"{where}: type {joint.type!r} is not supported", advice=freeze)
    if joint.mimics is not None and joint.mimics not in kept:
        raise RobotDescriptionError(
            f"{where}: it mimics {joint.mimics!r}, which does not move or is not in the file",
            advice=freeze,
        )
    if joint.limits is not None and not joint.limits[0] < joint.limits[1]:
        raise RobotDescriptionError(
            f"{where}: limit lower = {joint.limits[0]:g}, upper = {joint.limits[1]:g} leaves no "
            "room to move",
            advice=f"correct it, or {freeze}",
        )


def _check_frozen(joint: UrdfJoint, position: float) -> None:
    if not np.isfinite(position):
        raise RobotDescriptionError(
            f"frozen: position of {joint.name!r} is {position}", advice="not finite"
        )
    if joint.type not in MOVING and position != 0.0:
        raise RobotDescriptionError(
            f"frozen: joint {joint.name!r} of type {joint.type!r} can only be frozen at 0, "
            f"not at {position:g}"
        )


def _members(
    model: UrdfModel, positions: Mapping[str, float], friction: FrictionLaw
) -> list[Member]:
    """All joints with their bodies, parents first, in frames with the joint's axis as z."""
    order, parents = _tree(model)
    members: list[Member] = []
    turns: list[np.ndarray] = []  # the frame rule's A of each member
    place = {-1: -1}
    for i in order:
        joint = model.joints[i]
        place[i] = len(members)
        parent = place[parents[i]]
        fixed = joint.type == "fixed" or joint.name in positions
        turn = np.eye(3) if fixed else rotation_from_z_to(joint.axis)
        origin = joint.origin @ joint_motion(joint, positions.get(joint.name, 0.0))
        back = turns[parent].T if parent >= 0 else np.eye(3)
        pose = Pose(back, np.zeros(3)) @ origin @ Pose(turn, np.zeros(3))
        inertia = moved(model.links[joint.child], turn.T, np.zeros(3))
        members.append(
            Member(
                _joint(joint, parent, pose).with_friction(friction),
                Link(joint.child, inertia),
                fixed,
            )
        )
        turns.append(turn)
    return members


def _joint(joint: UrdfJoint, parent: int, pose: Pose) -> Joint:
    return Joint(
        name=joint.name,
        kind="prismatic" if joint.type == "prismatic" else "revolute",
        parent=parent,
        rotation=pose.rotation,
        translation=pose.translation,
        position_limits=joint.limits,
        rated_speed=joint.velocity,
        torque_limit=joint.effort,
    )


def joint_motion(joint: UrdfJoint, position: float) -> Pose:
    """Displacement of the child frame at a joint position [rad or m]."""
    if joint.type == "prismatic":
        return Pose(np.eye(3), position * joint.axis)
    return Pose(rotation_about(joint.axis, position), np.zeros(3))


def _tree(model: UrdfModel) -> tuple[list[int], list[int]]:
    """Joints in depth-first order, and the joint before each one (-1 at the root link)."""
    carried_by: dict[str, int] = {}
    for i, joint in enumerate(model.joints):
        if joint.child in carried_by:
            other = model.joints[carried_by[joint.child]].name
            raise RobotDescriptionError(
                f"link {joint.child!r} is the child of joints {other!r} and {joint.name!r}: a "
                "closed loop cannot be identified as a tree",
                advice="remove one of the two joints",
            )
        carried_by[joint.child] = i
    roots = [name for name in model.links if name not in carried_by]
    if len(roots) > 1:
        raise RobotDescriptionError(
            f"the links {', '.join(map(repr, roots))} have no parent joint, one root is needed",
            advice="connect them with fixed joints or remove them",
        )
    parents = [carried_by.get(joint.parent, -1) for joint in model.joints]
    order = tree_order(parents)
    if len(order) < len(model.joints):
        ring = [j.name for i, j in enumerate(model.joints) if i not in set(order)]
        raise RobotDescriptionError(
            f"the joints {', '.join(map(repr, ring))} form a ring without a root link",
            advice="remove the joint that closes it",
        )
    return order, parents


def _check_parents_first(joints: Sequence[Joint]) -> None:
    for i, joint in enumerate(joints):
        if joint.parent > i:
            raise RobotDescriptionError(
                f"joints: {joint.name!r} is listed before {joints[joint.parent].name!r}, which "
                "carries it",
                advice="list joints from the base outwards",
            )


def _nominal_friction(robot: Robot, model: UrdfModel) -> dict[str, float]:
    """Nominal ``fv`` and ``fc`` by parameter name, where file and friction law both have them."""
    written = {joint.name: {"fv": joint.damping, "fc": joint.friction} for joint in model.joints}
    return {
        f"{term.stem}{robot.label(i)}": written[joint.name][term.stem]
        for i, joint in enumerate(robot.tree.joints)
        for term in joint.friction.terms
        if written[joint.name].get(term.stem)
    }
