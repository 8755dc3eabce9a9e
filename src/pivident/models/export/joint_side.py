"""Joint properties of a format: damping, dry friction, springs, rotors, couplings as shafts.

Each parameter is divided into a part that the format can represent and a rest that is left out.
Pairs for the two directions become a mean, which is friction, and half their difference:

    fcp (1 + s)/2 - fcn (1 - s)/2 = (fcp + fcn)/2 s + (fcp - fcn)/2
    fvp max(dq, 0) + fvn min(dq, 0) = (fvp + fvn)/2 dq + (fvp - fvn)/2 |dq|

Coupled motors as shafts that turn with two joints.

A rotor that turns with v = dq_m + ρ dq_j and has the inertia, damping or friction d adds d v to the
torque of joint m and ρ d v to that of joint j. In the model its products are separate parameters
(iam fvm), its squares are part of ia and fv of the two joints. With D the 2 × 2 matrix of the
model, cross = ratio · fvm,

    D = [D_mm  cross]   =   d [1  ρ ]   +   [D_mm - d      0       ]
        [cross  D_jj]         [ρ  ρ²]       [    0     D_jj - ρ² d ]

with ρ = cross/d. The shaft's own share is d = fvm, for which ρ is the declared ratio. Where that
would leave a joint with a negative rest, another d between cross²/D_jj and D_mm is used: it exists
wherever D is positive semidefinite.

A rotor inertia that couples joints of two branches fills entries of M(q) that are zero by the
tree. Engines that store M as sparse as the tree cannot represent it, so it is left out.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

from pivident.models.runnable_model import RunnableModel
from pivident.robot.description import Coupling, Robot

#: Properties of joints that a format may have an element for.
JointProperty = Literal["damping", "dry friction", "offset", "spring", "rotor inertia", "coupling"]


@dataclass(frozen=True)
class Shaft:
    """A shaft that turns with v = dq_motor + ratio · dq_joint."""

    motor: int
    joint: int
    ratio: float
    armature: float = 0.0  # rotor inertia [kg m² or kg]
    damping: float = 0.0  # viscous friction [N m s/rad or N s/m]
    dry_friction: float = 0.0  # Coulomb friction [N m or N]


def divide_couplings(
    model: RunnableModel, armature: np.ndarray, damping: np.ndarray, supported: bool
) -> tuple[tuple[Shaft, ...], dict[str, float]]:
    """Shafts of a model, and the coupling parameters that are left out.

    What the shafts represent is subtracted in place from rotor inertias and damping (tree joints,).
    """
    shafts: dict[tuple[int, int, float], Shaft] = {}
    left_out: dict[str, float] = {}
    for p, value in zip(model.parameters, np.asarray(model.values).tolist(), strict=True):
        c = p.coupling
        if c is None or value == 0.0:
            continue
        if p.stem == "fcm":
            split = (value, c.ratio) if value > 0.0 else None
        else:
            own = armature if p.stem == "iam" else damping
            split = _rank_one(value, c.ratio, own[c.motor], own[c.joint])
            if p.stem == "iam" and not _on_one_chain(model.robot.tree, c):
                split = None
        if split is None or not supported:
            left_out[p.name] = value
            continue
        size, ratio = split
        if p.stem != "fcm":
            own[c.motor] -= size
            own[c.joint] -= ratio**2 * size
        before = shafts.get((c.motor, c.joint, ratio), Shaft(c.motor, c.joint, ratio))
        shafts[c.motor, c.joint, ratio] = Shaft(
            c.motor,
            c.joint,
            ratio,
            before.armature + (size if p.stem == "iam" else 0.0),
            before.damping + (size if p.stem == "fvm" else 0.0),
            before.dry_friction + (size if p.stem == "fcm" else 0.0),
        )
    return tuple(shafts.values()), left_out


def _on_one_chain(robot: Robot, coupling: Coupling) -> bool:
    """Whether one of the two joints carries the other."""
    far, near = max(coupling.motor, coupling.joint), min(coupling.motor, coupling.joint)
    return near in robot.ancestors(far)


def _rank_one(value: float, ratio: float, motor: float, joint: float) -> tuple[float, float] | None:
    """Size d and ratio ρ of the shaft, None if every shaft leaves a joint a negative rest."""
    cross = ratio * value
    if motor <= 0.0 or joint <= 0.0 or cross**2 > motor * joint:
        return None
    size = min(max(value, cross**2 / joint), motor)
    return size, ratio if size == value else cross / size


@dataclass(frozen=True, eq=False)
class JointSide:
    """Joint properties as a format represents them; arrays (tree joints,)."""

    damping: np.ndarray  # [N m s/rad or N s/m]
    dry_friction: np.ndarray  # level [N m or N]
    offset: np.ndarray  # constant torque [N m or N]
    stiffness: np.ndarray  # of a spring that rests at q = 0 [N m/rad or N/m]
    armature: np.ndarray  # rotor inertia [kg m² or kg]
    shafts: tuple[Shaft, ...]
    dry_parts: Mapping[str, float]  # parts of parameters in the dry friction, by name
    left_out: Mapping[str, float]  # parts that the format cannot represent, by name


@dataclass(frozen=True)
class _Share:
    """One property of one joint: its size, and the parts of parameters that it consists of."""

    kind: JointProperty | None
    joint: int
    size: float
    parts: Mapping[str, float]


def joint_side(model: RunnableModel, supported: frozenset[JointProperty]) -> JointSide:
    """Divide the joints' parameters into what a format supports and what it leaves out.

    Negative friction and rotor inertias, which a free estimate may have, are left out, and constant
    torques of passive joints, which are the bias of no motor.
    """
    count, driven = model.robot.tree.size, model.robot.places
    place = {kind: np.zeros(count) for kind in ("damping", "dry friction", "offset")}
    place |= {kind: np.zeros(count) for kind in ("spring", "rotor inertia")}
    dry_parts: dict[str, float] = {}
    left_out: dict[str, float] = {}
    for share in _shares(model):
        signed = share.kind in ("offset", "spring")
        motor = share.kind != "offset" or share.joint in driven
        if share.kind in supported and motor and (signed or share.size >= 0.0):
            place[share.kind][share.joint] += share.size
            if share.kind == "dry friction":
                dry_parts |= share.parts
            continue
        for name, part in share.parts.items():
            left_out[name] = left_out.get(name, 0.0) + part
    shafts, uncoupled = divide_couplings(
        model, place["rotor inertia"], place["damping"], "coupling" in supported
    )
    return JointSide(
        place["damping"],
        place["dry friction"],
        place["offset"],
        place["spring"],
        place["rotor inertia"],
        shafts,
        dry_parts,
        {name: part for name, part in (left_out | uncoupled).items() if part != 0.0},
    )


def _shares(model: RunnableModel) -> Iterator[_Share]:
    """All joint parameters except those of couplings.

    Presliding and Maxwell slip are dry friction once the joint has moved some way in one direction.
    """
    values = {p.name: float(v) for p, v in zip(model.parameters, model.values, strict=True)}
    backwards = {(p.joint, p.friction.column.name): p for p in model.parameters if p.friction}
    for p in model.parameters:
        value = values[p.name]
        if p.stem == "ia":
            yield _Share("rotor inertia", p.joint, value, {p.name: value})
        if p.friction is None or p.friction.column.is_backwards:
            continue
        element = p.friction.column.element
        if not p.friction.column.opposite:
            yield _Share(element, p.joint, value, {p.name: value})
            continue
        other = backwards[p.joint, p.friction.column.opposite].name
        mean, half = (value + values[other]) / 2.0, (value - values[other]) / 2.0
        yield _Share(element, p.joint, mean, {p.name: mean, other: mean})
        rest: JointProperty | None = "offset" if element == "dry friction" else None
        yield _Share(rest, p.joint, half, {p.name: half, other: -half})
