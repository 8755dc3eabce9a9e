"""Model → MJCF, the format of MuJoCo: bodies, joints, coupled shafts and motors.

Link frames are the model's, with the joint's axis as z. A motor's control is the joint torque tau
of the model; a constant torque of the joint is a bias of its motor. Shapes are for display only.
"""

from __future__ import annotations

import numpy as np

from pivident.errors import ExportError
from pivident.export.differences import differences
from pivident.export.joint_side import JointProperty, JointSide, joint_side
from pivident.export.robot_file import RobotFile
from pivident.export.shafts import Shaft
from pivident.export.sketch import Stick, sticks
from pivident.export.xml_text import comment, distinct, number, numbers, quoted, unlike
from pivident.models.link_bodies import is_possible, written_body
from pivident.models.runnable_model import RunnableModel
from pivident.robot.description import Joint

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
    robot = model.robot
    for i, link in enumerate(robot.links):
        if not is_possible(model.inertial(i)):
            raise ExportError(
                f"no body can have the inertial parameters of link {link.name!r}, and MuJoCo "
                "refuses it; export the physically consistent parameters"
            )
    side = joint_side(model, SUPPORTED)
    names = distinct([link.name for link in robot.links], robot.joint_names, ("world",))
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
        '    <geom contype="0" conaffinity="0" group="2" rgba="0.6 0.65 0.7 1"/>',
        "  </default>",
        "  <worldbody>",
        '    <light pos="0 0 3" dir="0 0 -1"/>',
        f"    <body name={quoted(unlike('base', names))}>",
        *(f"      {_geom(stick)}" for stick in sticks(model)[-1]),
    ]
    for i, joint in enumerate(robot.joints):
        if joint.parent < 0:
            out += [f"      {line}" for line in _body(model, side, names, i)]
    out += ["    </body>", "  </worldbody>"]
    out += _tendons(model, side)
    out += ["  <actuator>"]
    out += [f"    {_motor(j, side.offset[i])}" for i, j in enumerate(robot.joints)]
    out += ["  </actuator>", "</mujoco>", ""]
    sentences = differences(model, "MJCF", SUPPORTED, side.left_out)
    if side.dry_friction.any():
        sentences += (
            "MuJoCo's dry friction is a soft constraint, so a joint that sticks creeps slightly; "
            f"its time constant is {1e3 * FRICTION_REFERENCE[0]:g} ms (solreffriction)",
        )
    biased = [
        f"{joint.name} {off:.4g} {'N m' if joint.kind == 'revolute' else 'N'}"
        for joint, off in zip(robot.joints, side.offset.tolist(), strict=True)
        if off
    ]
    if biased:
        sentences += (
            "the constant torque of a joint is the bias of its motor, so the control is the "
            f"model's torque; without motors it is missing: {', '.join(biased)}",
        )
    return RobotFile("\n".join(out).encode(), sentences, format="mjcf", left_out=side.left_out)


def _body(model: RunnableModel, side: JointSide, names: tuple[str, ...], i: int) -> list[str]:
    """The body of a link, with the bodies that it carries inside."""
    robot, joint = model.robot, model.robot.joints[i]
    body = written_body(names[i], model.inertial(i))
    # MuJoCo diagonalises a fullinertia itself, before its version 4 to seven digits only
    moments, axes = body.principal
    pose = f'pos="{numbers(joint.translation)}" quat="{numbers(quaternion(joint.rotation))}"'
    lines = [
        f"<body name={quoted(names[i])} {pose}>",
        f'  <inertial pos="{numbers(body.center_of_mass)}" mass="{number(body.mass)}" '
        f'diaginertia="{numbers(moments)}" quat="{numbers(quaternion(axes))}"/>',
        f"  {_joint(joint, side, i)}",
        *(f"  {_geom(stick)}" for stick in sticks(model)[i]),
    ]
    for k, other in enumerate(robot.joints):
        if other.parent == i:
            lines += [f"  {line}" for line in _body(model, side, names, k)]
    return [*lines, "</body>"]


def _joint(joint: Joint, side: JointSide, i: int) -> str:
    kind = "hinge" if joint.kind == "revolute" else "slide"
    limits = ""
    if joint.position_limits is not None:
        limits = f' range="{numbers(joint.position_limits)}"'
    values = {
        "armature": side.armature[i],
        "damping": side.damping[i],
        "frictionloss": side.dry_friction[i],
        "stiffness": side.stiffness[i],
    }
    written = "".join(f' {key}="{number(value)}"' for key, value in values.items() if value)
    return f'<joint name={quoted(joint.name)} type="{kind}" axis="0 0 1"{limits}{written}/>'


def _tendons(model: RunnableModel, side: JointSide) -> list[str]:
    """Shafts that turn with two joints, as fixed tendons."""
    if not side.shafts:
        return []
    names = model.robot.joint_names
    lines = ["  <tendon>"]
    for k, shaft in enumerate(side.shafts):
        lines += [f"    {line}" for line in _shaft(shaft, names, k)]
    return [*lines, "  </tendon>"]


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


def _geom(stick: Stick) -> str:
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
