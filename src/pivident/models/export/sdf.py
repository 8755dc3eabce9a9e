"""Model → SDF 1.7, the format of Gazebo: links, inertials, joints with friction and springs.

Link frames are the model's, with the joint's axis as z; each link is placed relative to the one
that carries it, and the base is fixed to the world.
"""

from __future__ import annotations

import numpy as np

from pivident.models.export.differences import RobotFile, differences
from pivident.models.export.joint_side import JointProperty, JointSide, joint_side
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
from pivident.models.export_format import Format
from pivident.models.exported import refuse_loops
from pivident.models.runnable_model import RunnableModel, is_possible, link_inertias, written_body
from pivident.robot.description import Joint

#: Joint properties of SDF.
SUPPORTED: frozenset[JointProperty] = frozenset({"damping", "dry friction", "spring"})


def to_sdf(model: RunnableModel) -> RobotFile:
    """Write a model as SDF.

    Raises:
        RobotDescriptionError: the robot has closed loops, which it would take further plugins for.
    """
    refuse_loops(model.robot, "SDF")
    robot, side = model.robot, joint_side(model, SUPPORTED)
    names = distinct([link.name for link in robot.links], robot.joint_names, ("world",))
    base = unlike("base", names)
    parents = [base if joint.parent < 0 else names[joint.parent] for joint in robot.joints]
    shapes = sticks(model)
    out = [
        '<?xml version="1.0" encoding="utf-8"?>',
        comment("Frames: z is the joint's axis. Cylinders show where the links are."),
        '<sdf version="1.7">',
        f"  <model name={quoted(robot.name)}>",
        f"    <link name={quoted(base)}>",
        *(f"      {line}" for k, s in enumerate(shapes[-1]) for line in _visual(s, k)),
        "    </link>",
        f'    <joint name={quoted(unlike("fixed_base", robot.joint_names))} type="fixed">',
        f"      <parent>world</parent><child>{_text(base)}</child>",
        "    </joint>",
    ]
    for i, (name, parent) in enumerate(zip(names, parents, strict=True)):
        joint = robot.joints[i]
        pose = numbers((*joint.translation, *rpy(joint.rotation)))
        out += [
            f"    <link name={quoted(name)}>",
            f"      <pose relative_to={quoted(parent)}>{pose}</pose>",
            *(f"      {line}" for line in _inertial(name, model.inertial(i))),
            *(f"      {line}" for k, s in enumerate(shapes[i]) for line in _visual(s, k)),
            "    </link>",
        ]
    for i, joint in enumerate(robot.joints):
        out += [f"    {line}" for line in _joint(joint, parents[i], names[i], side, i)]
    sentences = differences(model, "SDF", SUPPORTED, side.left_out)
    sentences += (
        "SDF stores gravity in the world, not in the model; the model's is "
        f"{numbers(robot.gravity)} m/s² in the base frame",
    )
    if not all(is_possible(inertia) for inertia in link_inertias(model)):
        sentences += (
            "no body can have the inertial parameters of some links, and Gazebo refuses them; "
            "export the physically consistent parameters",
        )
    content = "\n".join([*out, "  </model>", "</sdf>", ""]).encode()
    return RobotFile(content, sentences, format="sdf", left_out=side.left_out, supported=SUPPORTED)


def _inertial(name: str, inertia: np.ndarray) -> list[str]:
    body = written_body(name, inertia)
    keys = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
    elements = body.inertia[np.triu_indices(3)]
    written = "".join(f"<{k}>{number(v)}</{k}>" for k, v in zip(keys, elements, strict=True))
    return [
        "<inertial>",
        f"  <pose>{numbers((*body.center_of_mass, 0.0, 0.0, 0.0))}</pose>",
        f"  <mass>{number(body.mass)}</mass>",
        f"  <inertia>{written}</inertia>",
        "</inertial>",
    ]


def _joint(joint: Joint, parent: str, child: str, side: JointSide, i: int) -> list[str]:
    limits: dict[str, float] = {}
    if joint.position_limits is not None:
        limits |= {"lower": joint.position_limits[0], "upper": joint.position_limits[1]}
    if joint.torque_limit is not None:
        limits["effort"] = joint.torque_limit
    if joint.rated_speed is not None:
        limits["velocity"] = joint.rated_speed
    dynamics = {
        "damping": side.damping[i],
        "friction": side.dry_friction[i],
        "spring_reference": 0.0,
        "spring_stiffness": side.stiffness[i],
    }
    return [
        f'<joint name={quoted(joint.name)} type="{joint.kind}">',
        f"  <parent>{_text(parent)}</parent><child>{_text(child)}</child>",
        "  <axis>",
        "    <xyz>0 0 1</xyz>",
        f"    <limit>{_elements(limits)}</limit>",
        f"    <dynamics>{_elements(dynamics)}</dynamics>",
        "  </axis>",
        "</joint>",
    ]


def _elements(values: dict[str, float]) -> str:
    return "".join(f"<{key}>{number(value)}</{key}>" for key, value in values.items())


def _visual(stick: Stick, k: int) -> list[str]:
    middle, turn, length = stick.cylinder()
    cylinder = _elements({"radius": stick.radius, "length": length})
    return [
        f'<visual name="stick_{k + 1}">',
        f"  <pose>{numbers((*middle, *turn))}</pose>",
        f"  <geometry><cylinder>{cylinder}</cylinder></geometry>",
        "</visual>",
    ]


def _text(name: str) -> str:
    """A name as the text of an element."""
    return quoted(name)[1:-1]


#: The format of Gazebo.
SDF = Format(
    "SDF",
    ".sdf",
    lambda model, _: to_sdf(model),
    not_loaded="nothing here reads SDF; Gazebo does",
)
