"""A robot as it stood when it was logged: joints that did not move, bodies that were mounted on it.

A URDF and an MJCF freeze joints while they are read. A table of Denavit and Hartenberg is a robot
already: a joint that stands still at q becomes a fixed one whose frame is turned (or shifted) by q,
and its link a part of the link that carries it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from pivident.foundation.errors import RobotDescriptionError, concerning
from pivident.robot.closed_chains import Member, chosen_order, merge_fixed
from pivident.robot.description import Joint, Robot
from pivident.robot.frames import Pose, rotation_z
from pivident.robot.inertia import from_center_of_mass, moved
from pivident.robot.naming import find_joint, nearest, repeated
from pivident.robot.transmission import Transmission
from pivident.robot.urdf import link_places
from pivident.robot.urdf_xml import file_content

#: What the link at the end of an arm may be called.
FLANGE = "flange"


def with_frozen_joints(
    robot: Robot, joints: Sequence[str] | None = None, frozen: Mapping[str, float] | None = None
) -> Robot:
    """The robot with some of its joints; the others stand still, and their links move along.

    Args:
        robot: a tree of joints with motors.
        joints: names of those to keep, in order; None: all that are not frozen.
        frozen: positions of joints that stand still [rad or m], by name; joints that are neither
            kept nor named stand at zero.

    Returns:
        The robot; itself where it keeps all of its joints in their order.

    Raises:
        RobotDescriptionError: a joint that is not there, named twice, or coupled with another one
            that is frozen; a mechanism with closed loops or a base that moves.
    """
    still = dict(frozen or {})
    for key, names in (("joints", joints or ()), ("frozen", still)):
        for name in names:
            if name not in robot.joint_names:
                raise RobotDescriptionError(
                    f"{key}: there is no moving joint {name!r}",
                    advice=nearest(name, robot.joint_names),
                ).about(key, *((name,) if key == "frozen" else ()))
    kept = [n for n in robot.joint_names if n not in still] if joints is None else list(joints)
    twice = sorted(set(kept) & set(still)) or repeated(kept)
    if twice:
        raise RobotDescriptionError(
            f"joints: {', '.join(twice)} cannot be kept {'and frozen' if still else 'twice'}",
            advice="name each joint once",
        ).about("joints")
    if tuple(kept) == robot.joint_names:
        return robot
    if robot.constraints is not None or robot.base_joints:
        raise RobotDescriptionError(
            f"robot {robot.name!r} has closed loops or a base that moves, whose joints cannot be "
            "frozen",
            advice="keep all joints",
        ).about("joints")
    if not kept:
        raise RobotDescriptionError("no joint is kept", advice="keep one").about("joints")
    members = [
        Member(_standing(joint, still.get(joint.name, 0.0)), link, fixed=joint.name not in kept)
        for joint, link in zip(robot.joints, robot.links, strict=True)
    ]
    moving, links = chosen_order(*merge_fixed(members), kept)
    late = [joint.name for i, joint in enumerate(moving) if joint.parent >= i]
    if late:
        raise RobotDescriptionError(
            f"joints: {late[0]!r} precedes the joint that carries it", advice="name that first"
        ).about("joints")
    return _with_drives_of(robot, replace(robot, joints=moving, links=links, couplings=(),
        rotor_inertia=np.zeros(len(kept)), transmission=Transmission.direct(len(kept)),
        friction_nominal={}))  # fmt: skip


def _standing(joint: Joint, q: float) -> Joint:
    """A joint whose frame at zero is the one that it has at q [rad or m]."""
    if not q:
        return joint
    turns = joint.kind == "revolute"
    motion = Pose(rotation_z(q), np.zeros(3)) if turns else Pose(np.eye(3), np.array([0, 0, q]))
    pose = Pose(joint.rotation, joint.translation) @ motion
    return replace(joint, rotation=pose.rotation, translation=pose.translation)


def _with_drives_of(robot: Robot, cut: Robot) -> Robot:
    """The robot that was cut down, with the drives and nominal friction of its joints."""
    own = [find_joint(robot.joint_names, name) for name in cut.joint_names]
    place = {old: new for new, old in enumerate(own)}
    others = [j for j in range(robot.size) if j not in place]
    ratios, given = robot.transmission.reduction, robot.transmission
    for j in others:
        shared = [i for i in own if ratios[i, j] or ratios[j, i]]
        shared += [i for c in robot.couplings for i in (c.motor, c.joint) if j in (c.motor, c.joint)
                   and i in place]  # fmt: skip
        if shared:
            raise RobotDescriptionError(
                f"joint {robot.joint_names[j]!r} shares a motor with "
                f"{robot.joint_names[shared[0]]!r}, which is kept",
                advice="keep both or none",
            ).about("joints")
    nominal = {
        f"{term.stem}{cut.label(new)}": robot.friction_nominal[name]
        for new, old in enumerate(own)
        for term in robot.joints[old].friction.terms
        if (name := f"{term.stem}{robot.label(old)}") in robot.friction_nominal
    }
    return replace(
        cut,
        rotor_inertia=robot.rotor_inertia[own],
        transmission=Transmission(
            ratios[np.ix_(own, own)], given.drive_gain[own], given.position_offset[own],
            given.gain_given[own],
        ),
        couplings=tuple(
            replace(c, motor=place[c.motor], joint=place[c.joint])
            for c in robot.couplings
            if c.motor in place
        ),
        friction_nominal=nominal,
    )  # fmt: skip


def with_body(
    robot: Robot,
    link: str,
    mass: float,
    center_of_mass: Sequence[float] = (0.0, 0.0, 0.0),
    inertia: Sequence[float] = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
) -> Robot:
    """The robot with one more body on a link, such as a tool that its description lacks.

    Args:
        robot: the robot.
        link: name of a link, of a fixed link of its URDF, or name or number of the joint that
            moves it; ``flange``: the last link, where none is called so.
        mass: of the body [kg]; negative where the description has a body that was not mounted.
        center_of_mass: in the frame of that link [m], shape (3,).
        inertia: about its centre of mass, ``xx xy xz yy yz zz`` [kg m²].

    Raises:
        RobotDescriptionError: there is no such link; names the nearest ones.
    """
    with concerning("link"):
        index, pose = _place(robot, link)
    xx, xy, xz, yy, yz, zz = inertia
    about_center = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    body = from_center_of_mass(mass, np.array(center_of_mass, dtype=float), about_center)
    links = list(robot.links)
    own = links[index]
    total = own.inertia + moved(body, pose.rotation, pose.translation)
    links[index] = replace(own, inertia=total, is_body=True)
    return replace(robot, links=tuple(links))


def carrier_of(robot: Robot, name: str | None) -> tuple[int, Pose | None]:
    """Index of the moving link that carries a load; the frame there of a link fixed to it.

    ``name``: of the link, or name or number (from 1) of the joint that moves it, or of a link of
    the URDF that is fixed to it; None: the last link.

    Raises:
        RobotDescriptionError: there is no such link, or it is a part of the base.
    """
    if name is None:
        return robot.size - 1, None
    try:
        return robot.link_index(name), None
    except RobotDescriptionError:
        return _place(robot, name)


def _place(robot: Robot, link: str) -> tuple[int, Pose]:
    """Index of the moving link that a link belongs to, and its frame there."""
    if robot.urdf is not None and robot.urdf.path and robot.constraints is None:
        places = link_places(file_content(Path(robot.urdf.path)), robot)
        if places.get(link, (0,))[0] < 0:
            raise RobotDescriptionError(
                f"link {link!r} does not move: it is a part of the base",
                advice="name a link that moves",
            )
        if link in places:
            return places[link]
    if link == FLANGE and FLANGE not in [own.name for own in robot.links]:
        return robot.size - 1, Pose.identity()
    return robot.link_index(link), Pose.identity()
