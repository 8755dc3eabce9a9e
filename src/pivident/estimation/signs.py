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


def gathered(
    robot: Robot,
    parameters: Sequence[Parameter],
    theta: np.ndarray,
    std: np.ndarray,
    remarks: Sequence[str],
) -> list[str]:
    """The remarks on negative parameters, those of reversed joints gathered to one.

    Args:
        robot: the robot.
        parameters: heads of the estimated groups.
        theta: estimates, shape (parameters,).
        std: their standard deviations.
        remarks: one sentence for each negative parameter that cannot be, in their order.
    """
    joints = reversed_joints(robot, parameters, theta, std)
    if not joints:
        return list(remarks)
    negative = [p for p, value in zip(parameters, theta, strict=True) if _impossible(p, value)]
    others = [text for p, text in zip(negative, remarks, strict=True) if p.joint not in joints]
    if len(joints) == robot.size:
        sentence = (
            "All signs are reversed: nearly all frictions and rotor inertias are negative. Flip "
            "tau: units = {tau = -1.0} where it is in N m or N, otherwise a negative gain."
        )
    else:
        names = ", ".join(robot.joints[j].name for j in joints)
        sentence = (
            f"The signs of {names} seem to be reversed: nearly all frictions and rotor inertias "
            "there are negative. Flip tau or q of these joints: a list under units, -1.0 in place "
            "of N m, N, rad or m."
        )
    return [sentence, *others]


def _impossible(parameter: Parameter, value: float) -> bool:
    return parameter.is_dissipative and value < 0.0
