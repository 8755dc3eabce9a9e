"""Joint properties of a format: damping, dry friction, springs, rotor inertias, couplings.

Each parameter is divided into a part that the format can represent and a rest that is left out.
Pairs for the two directions become a mean, which is friction, and half their difference:

    fcp (1 + s)/2 - fcn (1 - s)/2 = (fcp + fcn)/2 s + (fcp - fcn)/2
    fvp max(dq, 0) + fvn min(dq, 0) = (fvp + fvn)/2 dq + (fvp - fvn)/2 |dq|
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

from pivident.export.shafts import Shaft, divide_couplings
from pivident.models.runnable_model import RunnableModel

#: Properties of joints that a format may have an element for.
JointProperty = Literal["damping", "dry friction", "offset", "spring", "rotor inertia", "coupling"]


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
