"""Negative frictions and rotor inertias: one by one a remark each, all of a joint one cause.

A torque whose sign is reversed turns every parameter around. Saying so once helps; saying of each
parameter that it cannot be negative hides it.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pivident.dynamics.parameters import Parameter
from pivident.robot.description import Robot

#: Share of a joint's frictions and rotor inertias that has to be negative for a reversed sign.
NEARLY_ALL = 0.75

#: Deviations below zero from which a sign is no accident.
_CLEAR = 2.0


def reversed_joints(
    robot: Robot, parameters: Sequence[Parameter], theta: np.ndarray, std: np.ndarray
) -> tuple[int, ...]:
    """Joints whose torque seems to have the wrong sign.

    Args:
        robot: the robot.
        parameters: heads of the estimated groups.
        theta: estimates, shape (parameters,).
        std: their standard deviations.
    """

    def reversed_(joints: Sequence[int]) -> bool:
        own = [k for k, p in enumerate(parameters) if p.joint in joints and p.is_dissipative]
        clear = [k for k in own if theta[k] < -_CLEAR * std[k]]
        return len(clear) >= 2 and len(clear) >= NEARLY_ALL * len(own)

    everyone = tuple(range(robot.size))
    return everyone if reversed_(everyone) else tuple(j for j in everyone if reversed_([j]))


def sign_warnings(
    robot: Robot,
    parameters: Sequence[Parameter],
    names: Sequence[str],
    theta: np.ndarray,
    std: np.ndarray,
) -> list[str]:
    """Sentences about parameters that physics wants positive and the data made negative.

    Args:
        robot: the robot.
        parameters: heads of the estimated groups.
        names: names of the groups.
        theta: estimates, shape (parameters,).
        std: their standard deviations.
    """
    joints = reversed_joints(robot, parameters, theta, std)
    sentences = []
    if joints and len(joints) == robot.size:
        sentences.append(
            "All signs are reversed: nearly all frictions and rotor inertias are negative. Flip "
            "tau: units = {tau = -1.0} where it is in N m or N, otherwise a negative gain."
        )
    elif joints:
        reversed_names = ", ".join(robot.joints[j].name for j in joints)
        sentences.append(
            f"The signs of {reversed_names} seem to be reversed: nearly all frictions and rotor "
            "inertias there are negative. Flip tau or q of these joints: a list under units, -1.0 "
            "in place of N m, N, rad or m."
        )
    return sentences + [
        f"{name} = {value:.3g} {p.unit} is negative; friction and rotor inertia cannot be "
        f"({abs(value) / max(s, 1e-300):.1f} standard deviations below zero). Look at the "
        "low-speed mask, the signs of the torque and the friction law"
        + ("; a simulated loop takes it as zero." if p.friction is not None else ".")
        for p, name, value, s in zip(parameters, names, theta, std, strict=True)
        if p.is_dissipative and value < 0 and p.joint not in joints
    ]
