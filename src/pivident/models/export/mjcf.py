"""Model → MJCF, the format of MuJoCo: bodies, joints, coupled shafts, closed loops and motors.

Link frames are the model's, with the joint's axis as z. A motor's control is the joint torque tau
of the model; a constant torque of the joint is a bias of its motor. Shapes are for display only.

Closed loops become equality constraints between sites, joints and sums of joints:

    point       connect of two sites
    axis        two of them, at the origins and at a point of the axes
    full        weld of two sites
    r_1 q_1 + r_2 q_2 = r_0              joint, q_1 - q_1* = a_0 - r_2/r_1 (q_2 - q_2*)
    r_1 q_1 + r_2 q_2 + r_3 q_3 … = r_0  the length of a fixed tendon, which a tendon equality holds

A planar loop keeps the axes of its hinges parallel, so that one connect is enough there.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pivident.foundation.errors import ExportError
from pivident.models.export.differences import RobotFile, differences
from pivident.models.export.joint_side import JointProperty, JointSide, Shaft, joint_side
from pivident.models.export.load_back import verify_with_mujoco
from pivident.models.export.mjcf_bodies import (
    ALMOST_NOTHING,
    body_lines,
    drawn_bodies,
    geom,
    quaternion,
)
from pivident.models.export.xml_edit import (
    comment,
    distinct,
    number,
    numbers,
    quoted,
    sticks,
    unlike,
)
from pivident.models.export_format import Format
from pivident.models.runnable_model import RunnableModel, is_possible
from pivident.robot.closed_chains import link_frames
from pivident.robot.constraints import Closure, LinearConstraint
from pivident.robot.description import Joint, Robot
from pivident.robot.frames import Pose
from pivident.robot.refusals import without_base

#: Time constant and damping ratio with which MuJoCo closes loops, and its impedance: constraints
#: are soft, and time constants below two steps are raised.
LOOP_REFERENCE, LOOP_IMPEDANCE = (4e-3, 1.0), (0.99, 0.9999, 1e-4)

#: Distance of the second point on the axis of a hinge [m].
ALONG = 0.1


@dataclass(frozen=True, eq=False)
class LoopElements:
    """Lines of an MJCF that close loops."""

    sites: dict[int, list[str]]  # by link, -1 for the base
    tendons: list[str]
    equalities: list[str]


def loop_elements(robot: Robot) -> LoopElements:
    """All loops and proportions of a robot."""
    sites: dict[int, list[str]] = {}
    tendons: list[str] = []
    equalities: list[str] = []
    constraints = robot.constraints
    if constraints is None:
        return LoopElements(sites, tendons, equalities)
    used: list[str] = []
    first = 0
    for closure in constraints.closures:
        own = [k - first for k in constraints.kept if first <= k < first + closure.equations]
        turns = any(k >= 3 for k in own)
        first += closure.equations
        for name, element, frames in _pairs(robot, closure, turns):
            both = []
            for k, (link, frame) in enumerate(zip(closure.links, frames, strict=True)):
                both.append(unlike(f"{name}_{k + 1}", used))
                used.append(both[-1])
                sites.setdefault(link, []).append(_site(both[-1], frame))
            one, two = (quoted(site) for site in both)
            equalities.append(f"<{element} name={quoted(name)} site1={one} site2={two}/>")
    for proportion in constraints.linear:
        own_tendons, line = _proportion(robot, proportion)
        tendons += own_tendons
        equalities.append(line)
    return LoopElements(sites, tendons, equalities)


def _pairs(robot: Robot, closure: Closure, turns: bool) -> list[tuple[str, str, tuple[Pose, Pose]]]:
    """Name, element and frames of the pairs of sites that close a loop."""
    assert robot.constraints is not None
    if closure.kind == "point" or not turns:
        return [(closure.name, "connect", closure.frames)]
    # the equations hold for frames that differ by half turns too, sites of a weld do not
    poses = link_frames(robot.tree, robot.constraints.posture)
    ends = [
        poses[link] @ frame if link >= 0 else frame
        for link, frame in zip(closure.links, closure.frames, strict=True)
    ]
    half_turn = np.round(ends[1].rotation.T @ ends[0].rotation)
    one, two = closure.frames
    if closure.kind == "full":
        return [(closure.name, "weld", (one, Pose(two.rotation @ half_turn, two.translation)))]
    sides = 1.0, float(half_turn[2, 2])
    points = tuple(
        Pose(f.rotation, f.translation + side * ALONG * f.rotation[:, 2])
        for f, side in zip((one, two), sides, strict=True)
    )
    return [
        (closure.name, "connect", closure.frames),
        (f"{closure.name} axis", "connect", (points[0], points[1])),
    ]


def _site(name: str, frame: Pose) -> str:
    turn = "" if (frame.rotation == np.eye(3)).all() else numbers(quaternion(frame.rotation))
    turned = f' quat="{turn}"' if turn else ""
    return f'<site name={quoted(name)} pos="{numbers(frame.translation)}"{turned}/>'


def _proportion(robot: Robot, one: LinearConstraint) -> tuple[list[str], str]:
    """Joints in proportion: lines of a tendon, which few of them need, and the equality."""
    assert robot.constraints is not None
    tree, posture = robot.tree, robot.constraints.posture
    coupled = np.flatnonzero(one.ratios)
    names = [quoted(tree.joints[i].name) for i in coupled]
    follower = max(range(len(coupled)), key=lambda k: (coupled[k] not in robot.places, k))
    ratios = one.ratios[coupled] / one.ratios[coupled[follower]]
    rest = float((one.offset - one.ratios @ posture) / one.ratios[coupled[follower]])
    own = quoted(one.name)
    if len(coupled) > 2:
        tendon = [f"<fixed name={own}>"]
        tendon += [
            f'  <joint joint={name} coef="{number(ratio)}"/>'
            for name, ratio in zip(names, ratios.tolist(), strict=True)
        ]
        line = f'<tendon name={own} tendon1={own} polycoef="{number(rest)} 0 0 0 0"/>'
        return [*tendon, "</fixed>"], line
    leader, slope = "", 0.0
    if len(coupled) == 2:
        leader, slope = f" joint2={names[1 - follower]}", -float(ratios[1 - follower])
    coefficients = f'polycoef="{number(rest)} {number(slope)} 0 0 0"'
    return [], f"<joint name={own} joint1={names[follower]}{leader} {coefficients}/>"


#: Joint properties of MJCF: all but friction of other forms.
SUPPORTED: frozenset[JointProperty] = frozenset(
    {"damping", "dry friction", "offset", "spring", "rotor inertia", "coupling"}
)

#: Time step in the file [s].
TIME_STEP = 1e-3

#: Time constant and damping ratio of MuJoCo's dry friction, a soft constraint. Its default of 20 ms
#: lets joints creep where they should stick; below two time steps MuJoCo raises it.
FRICTION_REFERENCE = (4e-3, 1.0)


def to_mjcf(model: RunnableModel) -> RobotFile:
    """Write a model as MJCF; MuJoCo refuses links that are not possible bodies."""
    robot, tree = model.robot, model.robot.tree
    without_base(robot, "a file of MJCF", "export it as JSON")
    for i, link in enumerate(tree.links):
        if link.is_body and not is_possible(model.inertial(i)):
            raise ExportError(
                f"no body can have the inertial parameters of link {link.name!r}, and MuJoCo "
                "refuses it",
                advice="export the physically consistent parameters",
            )
    side, loops, bodies = joint_side(model, SUPPORTED), loop_elements(robot), drawn_bodies(robot)
    names = distinct([link.name for link in tree.links], tree.joint_names, ("world",))
    out = [
        '<?xml version="1.0" encoding="utf-8"?>',
        f"<mujoco model={quoted(robot.name)}>",
        "  " + comment("Frames: z is the joint's axis. Controls are joint torques in N m (N)."),
        '  <compiler angle="radian" autolimits="true" inertiafromgeom="false"/>',
        f'  <option gravity="{numbers(robot.gravity)}" timestep="{number(TIME_STEP)}" '
        'integrator="implicitfast"/>',
        "  <default>",
        f'    <joint solreffriction="{numbers(FRICTION_REFERENCE)}"/>',
        f'    <tendon solreffriction="{numbers(FRICTION_REFERENCE)}"/>',
        *_loop_default(loops),
        '    <geom contype="0" conaffinity="0" group="2" rgba="0.6 0.65 0.7 1"/>',
        "  </default>",
        "  <worldbody>",
        '    <light pos="0 0 3" dir="0 0 -1"/>',
        f"    <body name={quoted(unlike('base', names))}>",
        *(f"      {geom(stick)}" for stick in sticks(model)[-1]),
        *(f"      {site}" for site in loops.sites.get(-1, [])),
        *(f"      {line}" for line in body_lines(model, side, names, bodies, loops.sites)),
        "    </body>",
        "  </worldbody>",
        *_tendons(tree, side, loops),
        *_equalities(loops),
        "  <actuator>",
        *(
            f"    {_motor(joint, side.offset[i])}"
            for i, joint in zip(robot.places, robot.joints, strict=True)
        ),
        "  </actuator>",
        "</mujoco>",
        "",
    ]
    sentences = (*differences(model, "MJCF", SUPPORTED, side.left_out), *_of_mujoco(model, side))
    if loops.equalities:
        drawn = [body.link for group in bodies.values() for body in group]
        sentences += _of_loops([names[i] for i in drawn if not tree.links[i].is_body])
    content = "\n".join(out).encode()
    return RobotFile(content, sentences, format="mjcf", left_out=side.left_out, supported=SUPPORTED)


def _of_mujoco(model: RunnableModel, side: JointSide) -> tuple[str, ...]:
    """How MuJoCo's dry friction and motors differ from the model's."""
    sentences: tuple[str, ...] = ()
    if side.dry_friction.any():
        sentences += (
            "MuJoCo's dry friction is a soft constraint, so a joint that sticks creeps slightly; "
            f"its time constant is {1e3 * FRICTION_REFERENCE[0]:g} ms (solreffriction)",
        )
    biased = [
        f"{joint.name} {off:.4g} {'N m' if joint.kind == 'revolute' else 'N'}"
        for joint, off in zip(model.robot.tree.joints, side.offset.tolist(), strict=True)
        if off
    ]
    if biased:
        sentences += (
            "the constant torque of a joint is the bias of its motor, so the control is the "
            f"model's torque; without motors it is missing: {', '.join(biased)}",
        )
    return sentences


def _of_loops(frames: list[str]) -> tuple[str, ...]:
    """How MuJoCo's loops differ from the model's."""
    sentences: tuple[str, ...] = (
        "MuJoCo closes loops by soft constraints, which give way under load; their time constant "
        f"is {1e3 * LOOP_REFERENCE[0]:g} ms (solref), and the file starts where they are closed",
    )
    if frames:
        sentences += (
            f"MuJoCo has no frame without a body; {ALMOST_NOTHING:g} kg are written for "
            f"{', '.join(map(repr, frames))}",
        )
    return sentences


def _loop_default(loops: LoopElements) -> list[str]:
    if not loops.equalities:
        return []
    return [
        f'    <equality solref="{numbers(LOOP_REFERENCE)}" solimp="{numbers(LOOP_IMPEDANCE)}"/>'
    ]


def _equalities(loops: LoopElements) -> list[str]:
    if not loops.equalities:
        return []
    return ["  <equality>", *(f"    {line}" for line in loops.equalities), "  </equality>"]


def _tendons(tree: Robot, side: JointSide, loops: LoopElements) -> list[str]:
    """Shafts that turn with two joints, and proportions of many, as fixed tendons."""
    if not side.shafts and not loops.tendons:
        return []
    lines = ["  <tendon>"]
    for k, shaft in enumerate(side.shafts):
        lines += [f"    {line}" for line in _shaft(shaft, tree.joint_names, k)]
    return [*lines, *(f"    {line}" for line in loops.tendons), "  </tendon>"]


def _shaft(shaft: Shaft, names: tuple[str, ...], k: int) -> list[str]:
    values = {
        "armature": shaft.armature,
        "damping": shaft.damping,
        "frictionloss": shaft.dry_friction,
    }
    written = "".join(f' {key}="{number(value)}"' for key, value in values.items() if value)
    return [
        f"<fixed name={quoted(f'shaft_{k + 1}_of_{names[shaft.motor]}')}{written}>",
        f'  <joint joint={quoted(names[shaft.motor])} coef="1"/>',
        f'  <joint joint={quoted(names[shaft.joint])} coef="{number(shaft.ratio)}"/>',
        "</fixed>",
    ]


def _motor(joint: Joint, offset: float) -> str:
    """A motor whose control is the torque of the model, friction and offset included."""
    limits = ""
    if joint.torque_limit is not None:
        limits = f' ctrlrange="{numbers((-joint.torque_limit, joint.torque_limit))}"'
    name = quoted(joint.name)
    if offset == 0.0:
        return f"<motor name={name} joint={name}{limits}/>"
    bias = f'biastype="affine" biasprm="{number(-offset)} 0 0"'
    return f"<general name={name} joint={name}{limits} {bias}/>"


#: The format of MuJoCo.
MJCF = Format(
    "MJCF",
    ".xml",
    lambda model, _: to_mjcf(model),
    (lambda file, model, options: verify_with_mujoco(file, model, frozen=options.frozen),),
)
