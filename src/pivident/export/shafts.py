"""Coupled motors as shafts that turn with two joints.

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

from dataclasses import dataclass

import numpy as np

from pivident.models.runnable_model import RunnableModel
from pivident.robot.description import Coupling, Robot


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
