"""A new URDF of a robot without one: frames, limits, inertials, followers, cylinders to look at."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from pivident.foundation.errors import ExportError
from pivident.models.export.joint_side import JointSide
from pivident.models.export.xml_edit import (
    Stick,
    comment,
    distinct,
    number,
    numbers,
    quoted,
    rpy,
    sticks,
    unlike,
)
from pivident.models.exported import refuse_loops
from pivident.models.runnable_model import RunnableModel, link_inertias, written_body
from pivident.robot.closed_chains import proportions
from pivident.robot.description import Joint, Robot


def inertial_lines(name: str, inertia: np.ndarray) -> list[str]:
    """An ``<inertial>`` element about the centre of mass, in axes of the link; zeros: no mass."""
    mass, center, tensor = 0.0, np.zeros(3), np.zeros((3, 3))
    if inertia.any():
        body = written_body(name, inertia)
        mass, center, tensor = body.mass, body.center_of_mass, body.inertia
    keys = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
    elements = tensor[np.triu_indices(3)]
    written = " ".join(f'{k}="{number(v)}"' for k, v in zip(keys, elements, strict=True))
    return [
        "<inertial>",
        f'  <origin xyz="{numbers(center)}" rpy="0 0 0"/>',
        f'  <mass value="{number(mass)}"/>',
        f"  <inertia {written}/>",
        "</inertial>",
    ]


def dynamics_line(damping: float, friction: float) -> str:
    """A ``<dynamics>`` element."""
    return f'<dynamics damping="{number(damping)}" friction="{number(friction)}"/>'


#: Value of unknown speed and torque limits; zero would stop the joint in simulators.
UNKNOWN = 1e6

#: Range in the file of a prismatic joint of unknown range, and of one that others follow [m, rad].
UNKNOWN_RANGE = (-100.0, 100.0)


def new_urdf(model: RunnableModel, side: JointSide) -> str:
    """The text of a URDF."""
    robot, following = model.robot.tree, mimics(model.robot)
    names = distinct([link.name for link in robot.links], robot.joint_names)
    base = unlike("base", names)
    shapes = sticks(model)
    out = [
        '<?xml version="1.0" encoding="utf-8"?>',
        comment("Frames: z is the joint's axis. Cylinders show where the links are."),
        f"<robot name={quoted(robot.name)}>",
        f"  <link name={quoted(base)}>",
        *(f"    {line}" for stick in shapes[-1] for line in _visual(stick)),
        "  </link>",
    ]
    for i, (name, inertia) in enumerate(zip(names, link_inertias(model), strict=True)):
        out += [
            f"  <link name={quoted(name)}>",
            *(f"    {line}" for line in inertial_lines(name, inertia)),
            *(f"    {line}" for stick in shapes[i] for line in _visual(stick)),
            "  </link>",
        ]
    for i, joint in enumerate(_with_ranges(robot, following)):
        parent = base if joint.parent < 0 else names[joint.parent]
        lines = _joint(joint, parent, names[i], side.damping[i], side.dry_friction[i])
        if i in following:
            lines.insert(-1, f"    {following[i].element(robot)}")
        out += lines
    return "\n".join([*out, "</robot>", ""])


def unknown_limits(robot: Robot) -> tuple[str, ...]:
    """Sentences on limits that the robot's description does not have."""
    what = {
        "speed": [j.name for j in robot.joints if j.rated_speed is None],
        "torque": [j.name for j in robot.joints if j.torque_limit is None],
        "range": [j.name for j in robot.joints if j.position_limits is None],
    }
    turn = "" if robot.constraints is None else " or rad"
    slides = "a slide" if robot.constraints is None else "a slide, or one that others follow,"
    return tuple(
        f"no {key} limit is known of {', '.join(map(repr, names))}, and "
        + (
            f"they turn without limit ({slides} goes from {UNKNOWN_RANGE[0]:g} to "
            f"{UNKNOWN_RANGE[1]:g} m{turn})"
            if key == "range"
            else f"{UNKNOWN:g} is written"
        )
        for key, names in what.items()
        if names
    )


def _with_ranges(robot: Robot, following: Mapping[int, Mimic]) -> list[Joint]:
    """Joints with the range of their leader; readers let none follow that turns without limit."""
    joints = list(robot.joints)
    for i in {one.leader for one in following.values()}:
        joints[i] = replace(joints[i], position_limits=joints[i].position_limits or UNKNOWN_RANGE)
    for i, one in following.items():
        own = joints[i].position_limits or one.limits(joints[one.leader], UNKNOWN_RANGE)
        joints[i] = replace(joints[i], position_limits=own)
    return joints


def joint_type(joint: Joint) -> str:
    """``prismatic``, ``revolute``, or ``continuous`` where no range is known."""
    if joint.kind == "prismatic":
        return "prismatic"
    return "continuous" if joint.position_limits is None else "revolute"


def _joint(joint: Joint, parent: str, child: str, damping: float, friction: float) -> list[str]:
    kind = joint_type(joint)
    lower, upper = joint.position_limits or UNKNOWN_RANGE
    span = "" if kind == "continuous" else f'lower="{number(lower)}" upper="{number(upper)}" '
    effort, speed = joint.torque_limit or UNKNOWN, joint.rated_speed or UNKNOWN
    xyz, turn = numbers(joint.translation), numbers(rpy(joint.rotation))
    return [
        f'  <joint name={quoted(joint.name)} type="{kind}">',
        f'    <origin xyz="{xyz}" rpy="{turn}"/>',
        f"    <parent link={quoted(parent)}/>",
        f"    <child link={quoted(child)}/>",
        '    <axis xyz="0 0 1"/>',
        f'    <limit {span}effort="{number(effort)}" velocity="{number(speed)}"/>',
        f"    {dynamics_line(damping, friction)}",
        "  </joint>",
    ]


def _visual(stick: Stick) -> list[str]:
    middle, turn, length = stick.cylinder()
    cylinder = f'<cylinder radius="{number(stick.radius)}" length="{number(length)}"/>'
    return [
        "<visual>",
        f'  <origin xyz="{numbers(middle)}" rpy="{numbers(turn)}"/>',
        f"  <geometry>{cylinder}</geometry>",
        "</visual>",
    ]


@dataclass(frozen=True)
class Mimic:
    """How a joint follows another one."""

    leader: int  # index of the leading joint in the tree
    multiplier: float
    offset: float  # [rad or m]

    def element(self, robot: Robot) -> str:
        """The element of the follower."""
        return (
            f"<mimic joint={quoted(robot.tree.joints[self.leader].name)} "
            f'multiplier="{number(self.multiplier)}" offset="{number(self.offset)}"/>'
        )

    def limits(self, leader: Joint, unknown: tuple[float, float]) -> tuple[float, float]:
        """Range of the follower where the leader moves within its own."""
        ends = [self.multiplier * end + self.offset for end in leader.position_limits or unknown]
        return min(ends), max(ends)


def mimics(robot: Robot) -> Mapping[int, Mimic]:
    """Followers by their index in the tree.

    Raises:
        RobotDescriptionError: links form closed loops.
        ExportError: a joint follows several others.
    """
    found = proportions(robot)
    if found is None:
        refuse_loops(robot, "URDF")
        return {}
    ratios, rest = found
    made: dict[int, Mimic] = {}
    for i, joint in enumerate(robot.tree.joints):
        if i in robot.places:
            continue
        leaders = np.flatnonzero(ratios[i])
        if len(leaders) > 1:
            names = " and ".join(repr(robot.joints[a].name) for a in leaders)
            raise ExportError(
                f"joint {joint.name!r} follows {names}, and <mimic> of a URDF names one joint",
                advice="export it as MJCF, or as JSON, which read_model reads back",
            )
        # one that stands still follows any joint by nothing
        a = int(leaders[0]) if leaders.size else 0
        made[i] = Mimic(robot.places[a], float(ratios[i, a]), float(rest[i]))
    return made
