"""An arm as URDF and as MJCF, with given bodies."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .arms import Arm, JointPlace
from .truth import Body


def urdf(arm: Arm, bodies: Sequence[Body]) -> str:
    """The arm as URDF: geometry, limits and bodies, no friction.

    Args:
        arm: the drawing.
        bodies: of the links, true ones or those of a vendor's file.
    """
    lines = [f'<robot name="{arm.name}">', '  <link name="base_link"/>']
    parent = "base_link"
    for joint, body in zip(arm.joints, bodies, strict=True):
        child = f"{joint.name}_link"
        xx, xy, xz, yy, yz, zz = _six(body.inertia)
        low, high = joint.limits
        lines += [
            f'  <joint name="{joint.name}" type="{joint.kind}">',
            f'    <parent link="{parent}"/><child link="{child}"/>',
            f'    <origin xyz="{_text(joint.xyz)}" rpy="{_text(joint.rpy)}"/>',
            f'    <axis xyz="{_text(joint.axis)}"/>',
            f'    <limit lower="{low:g}" upper="{high:g}" velocity="{joint.speed:g}" '
            f'effort="{joint.effort:g}"/>',
            "  </joint>",
            f'  <link name="{child}">',
            f'    <inertial><origin xyz="{_text(body.center)}" rpy="0 0 0"/>'
            f'<mass value="{body.mass:.10g}"/>',
            f'      <inertia ixx="{xx}" ixy="{xy}" ixz="{xz}" iyy="{yy}" iyz="{yz}" izz="{zz}"/>',
            "    </inertial>",
            "  </link>",
        ]
        parent = child
    return "\n".join([*lines, "</robot>\n"])


def mjcf(arm: Arm, bodies: Sequence[Body], rotor: Sequence[float], shafts=()) -> str:
    """The arm for MuJoCo: rigid bodies and rotors as armature, no friction, no contacts.

    Args:
        arm: the drawing.
        bodies: of the links.
        rotor: rotor inertias on the joint side [kg m² or kg].
        shafts: motors that turn with two joints; each is a fixed tendon with an armature.
    """
    opening, closing = [], []
    for joint, body, own in zip(arm.joints, bodies, rotor, strict=True):
        xx, xy, xz, yy, yz, zz = _six(body.inertia)
        kind = "hinge" if joint.kind == "revolute" else "slide"
        opening += [
            f'<body name="{joint.name}_link" pos="{_text(joint.xyz)}" quat="{_quaternion(joint)}">',
            f'<inertial pos="{_text(body.center)}" mass="{body.mass:.17g}" '
            f'fullinertia="{xx} {yy} {zz} {xy} {xz} {yz}"/>',
            f'<joint name="{joint.name}" type="{kind}" axis="{_text(joint.axis)}" '
            f'armature="{own:.17g}"/>',
        ]
        closing.append("</body>")
    tendons = [
        f'<fixed armature="{s.inertia:.17g}"><joint joint="{arm.joints[s.motor].name}" coef="1"/>'
        f'<joint joint="{arm.joints[s.joint].name}" coef="{s.ratio:.17g}"/></fixed>'
        for s in shafts
    ]
    return "\n".join(
        [
            f'<mujoco model="{arm.name}"><compiler angle="radian" boundinertia="0"/>',
            '<option gravity="0 0 -9.81"><flag contact="disable"/></option><worldbody>',
            *opening,
            *closing,
            "</worldbody>",
            *(["<tendon>", *tendons, "</tendon>"] if tendons else []),
            "</mujoco>",
        ]
    )


def _six(inertia: np.ndarray) -> list[str]:
    """Elements xx, xy, xz, yy, yz, zz of a symmetric matrix as text."""
    return [f"{inertia[i, j]:.17g}" for i in range(3) for j in range(i, 3)]


def _text(values: Sequence[float]) -> str:
    return " ".join(f"{value:.17g}" for value in values)


def _quaternion(joint: JointPlace) -> str:
    """Roll, pitch and yaw of a URDF as a quaternion: Rz(yaw) Ry(pitch) Rx(roll)."""
    from scipy.spatial.transform import Rotation

    x, y, z, w = Rotation.from_euler("xyz", joint.rpy).as_quat()
    return _text((w, x, y, z))
