"""The joints of a ``pinocchio.Model``, in the frames of `pivident.robot.description`.

Only the given object is read; Pinocchio itself is not imported. A joint's motion subspace S, six
numbers (linear part, angular part), holds its axis a in the joint's frame. The frame of a link is
that frame turned by A, the smallest rotation that takes z to a, as for a URDF:

    rotation = A_pᵀ R A,    translation = A_pᵀ p,    inertia seen from the frame turned by A

with R, p the placement of the joint in its parent's frame and A_p the turn of the parent.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from pivident.foundation.errors import RobotDescriptionError
from pivident.robot.frames import rotation_from_z_to
from pivident.robot.inertia import from_center_of_mass, moved

#: Pinocchio's names of joints with one degree of freedom about or along a fixed axis.
_REVOLUTE = re.compile(r"JointModelR(UB)?[XYZ]|JointModelRevolute(Unbounded)?Unaligned")
_PRISMATIC = re.compile(r"JointModelP[XYZ]|JointModelPrismaticUnaligned")

#: Bounds that Pinocchio writes where there are none.
_UNBOUNDED = 1e300


@dataclass(frozen=True, eq=False)
class ModelJoint:
    """A joint of a model with the body that it moves.

    Attributes:
        name: name of the joint.
        link: name of the body.
        kind: ``revolute`` or ``prismatic``.
        parent: index of the joint it hangs on, -1 for the base.
        rotation: of the link frame in the parent's at q = 0, shape (3, 3).
        translation: likewise [m], shape (3,).
        inertia: ten inertial parameters in the link frame, shape (10,).
        position_limits: [rad or m], or None.
        speed_limit: [rad/s or m/s], or None.
        torque_limit: [N m or N], or None.
        rotor_inertia: armature, or rotor inertia times the squared gear ratio [kg m² or kg].
        friction: ``fv`` (damping) and ``fc`` (dry friction), in SI units; zero where unknown.
    """

    name: str
    link: str
    kind: Literal["revolute", "prismatic"]
    parent: int
    rotation: np.ndarray
    translation: np.ndarray
    inertia: np.ndarray
    position_limits: tuple[float, float] | None
    speed_limit: float | None
    torque_limit: float | None
    rotor_inertia: float
    friction: dict[str, float]


def model_joints(model: Any) -> Iterator[ModelJoint]:
    """The joints of a ``pinocchio.Model``, parents before children.

    Raises:
        RobotDescriptionError: a joint has not exactly one degree of freedom about or along a
            fixed axis, or the object is no such model.
    """
    try:
        names, placements = list(model.names), list(model.jointPlacements)
        joints, bodies = list(model.joints), list(model.inertias)
    except (AttributeError, TypeError) as error:
        raise RobotDescriptionError(
            f"a {type(model).__name__} is no pinocchio.Model",
            advice="give what pinocchio.buildModelFromUrdf returns, or read the file with "
            "pivident.robot.read_urdf",
        ) from error
    links = _link_names(model)
    turns = [np.eye(3)]  # A of the base and of each joint
    for i in range(1, len(names)):
        kind = _kind(str(names[i]), joints[i].shortname())
        turn = rotation_from_z_to(_axis(joints[i], model.nq, kind))
        parent, placement, body = int(model.parents[i]), placements[i], bodies[i]
        back = turns[parent].T
        inertia = from_center_of_mass(body.mass, np.array(body.lever), np.array(body.inertia))
        turns.append(turn)
        yield ModelJoint(
            name=str(names[i]),
            link=links.get(i, str(names[i])),
            kind=kind,
            parent=parent - 1,
            rotation=back @ np.array(placement.rotation) @ turn,
            translation=back @ np.array(placement.translation),
            inertia=moved(inertia, turn.T, np.zeros(3)),
            position_limits=_range(model, joints[i]),
            speed_limit=_limit(model.velocityLimit[joints[i].idx_v]),
            torque_limit=_limit(model.effortLimit[joints[i].idx_v]),
            rotor_inertia=_rotor_inertia(model, joints[i].idx_v),
            friction={
                "fv": _element(model, "damping", joints[i].idx_v),
                "fc": _element(model, "friction", joints[i].idx_v),
            },
        )


def _kind(name: str, type_: str) -> Literal["revolute", "prismatic"]:
    """Kind of a joint from Pinocchio's name of its type."""
    if _REVOLUTE.fullmatch(type_):
        return "revolute"
    if _PRISMATIC.fullmatch(type_):
        return "prismatic"
    step = (
        "build the model without a root joint: only fixed bases are supported"
        if type_ == "JointModelFreeFlyer"
        else f"lock it with pinocchio.buildReducedModel(model, [model.getJointId({name!r})], q)"
    )
    raise RobotDescriptionError(
        f"joint {name!r} is a {type_.removeprefix('JointModel')} joint",
        advice=f"joints need one degree of freedom about or along a fixed axis. Next step: {step}",
    )


def _axis(joint: Any, size: int, kind: str) -> np.ndarray:
    """Unit vector of a joint's axis in its own frame, from its motion subspace."""
    q = np.zeros(size)
    if joint.nq == 2:  # cosine and sine
        q[joint.idx_q] = 1.0
    data = joint.createData()
    joint.calc(data, q)
    subspace = np.asarray(data.S, dtype=float).reshape(6)
    axis = subspace[3:] if kind == "revolute" else subspace[:3]
    return axis / np.linalg.norm(axis)


def _link_names(model: Any) -> dict[int, str]:
    """Name of the first body on each joint."""
    names: dict[int, str] = {}
    for frame in getattr(model, "frames", ()):
        if str(frame.type) == "BODY":
            parent = frame.parentJoint if hasattr(frame, "parentJoint") else frame.parent
            names.setdefault(int(parent), str(frame.name))
    return names


def _range(model: Any, joint: Any) -> tuple[float, float] | None:
    """Lowest and highest position; a joint without bounds has none."""
    if joint.nq != 1:
        return None
    low = float(model.lowerPositionLimit[joint.idx_q])
    high = float(model.upperPositionLimit[joint.idx_q])
    bounded = np.isfinite([low, high]).all() and low > -_UNBOUNDED and high < _UNBOUNDED
    return (low, high) if bounded else None


def _limit(value: float) -> float | None:
    """A limit, or None: Pinocchio writes zero, infinity or the largest number where unknown."""
    return float(value) if 0.0 < value < _UNBOUNDED else None


def _rotor_inertia(model: Any, index: int) -> float:
    """Armature; where it is zero, rotor inertia times the squared gear ratio."""
    geared = _element(model, "rotorInertia", index) * _element(model, "rotorGearRatio", index) ** 2
    return _element(model, "armature", index) or geared


def _element(model: Any, name: str, index: int) -> float:
    """An element of a vector that older versions of Pinocchio may not have."""
    return float(getattr(model, name)[index]) if hasattr(model, name) else 0.0
