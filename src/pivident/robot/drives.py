"""Drives of a robot: rotor inertias, reduction, drive gains and coupled motors.

A URDF does not contain them; a modified DH file may. `with_drives` adds them to a robot, by joint
name or in the order of the joints.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from pivident.foundation.errors import RobotDescriptionError, require_known
from pivident.robot.description import Coupling, Robot
from pivident.robot.naming import find_joint
from pivident.robot.transmission import Transmission

#: One number for each joint: in order, or by joint name (joints left out keep their value).
PerJoint = Sequence[float] | np.ndarray | Mapping[str, float]

#: The whole reduction matrix, shape (joints, joints).
Matrix = Sequence[Sequence[float]]


def with_drives(
    robot: Robot,
    *,
    rotor_inertia: PerJoint | None = None,
    reduction: PerJoint | Matrix | None = None,
    drive_gain: PerJoint | None = None,
    position_offset: PerJoint | None = None,
    couplings: Sequence[Coupling | tuple[str, str]] | None = None,
) -> Robot:
    """The same robot with other drives; what is not given stays as it is.

    Args:
        robot: the robot.
        rotor_inertia: inertia of each motor on the joint side [kg m² or kg].
        reduction: motor position per joint position, one for each joint, or the whole matrix of
            shape (joints, joints) with couplings off its diagonal.
        drive_gain: motor torque per unit of command.
        position_offset: joint position of the model where the log reads zero [rad or m].
        couplings: motors that also turn with a second joint, as `Coupling` or as the names
            (motor's joint, second joint); then the ratio is the one the reduction implies.

    Returns:
        A new robot; the given one stays as it is.

    Raises:
        RobotDescriptionError: an unknown joint, a missing or extra number, a value that is not
            finite, a negative rotor inertia or a singular reduction.
    """
    names = robot.joint_names
    before = robot.transmission
    rotor = _per_joint("rotor_inertia", rotor_inertia, names, robot.rotor_inertia)
    if (rotor < 0.0).any():
        worst = int(np.argmin(rotor))
        raise RobotDescriptionError(
            f"rotor_inertia of joint {names[worst]!r} is {rotor[worst]:g}",
            advice="it cannot be negative",
        )
    matrix = _reduction_matrix(reduction, names, before.reduction)
    transmission = Transmission(
        reduction=matrix,
        drive_gain=_per_joint("drive_gain", drive_gain, names, before.drive_gain),
        position_offset=_per_joint(
            "position_offset", position_offset, names, before.position_offset
        ),
        gain_given=before.gain_given | _named(drive_gain, names),
    )
    coupled = robot.couplings
    if couplings is not None:
        coupled = tuple(
            entry if isinstance(entry, Coupling) else implied_coupling(names, matrix, *entry)
            for entry in couplings
        )
    return replace(robot, rotor_inertia=rotor, transmission=transmission, couplings=coupled)


def implied_coupling(
    names: Sequence[str], reduction: np.ndarray, motor: str, joint: str
) -> Coupling:
    """The coupling of a motor with a second joint, both by name or number (from 1), with its ratio.

    The rotor turns with N_mm dq_m + N_mj dq_j, so referred to the motor's own joint the ratio is
    N_mj / N_mm; it is 1 where the reduction has no such element.
    """
    m, j = find_joint(names, motor), find_joint(names, joint)
    return Coupling(motor=m, joint=j, ratio=float(reduction[m, j] / reduction[m, m]) or 1.0)


def _reduction_matrix(
    given: PerJoint | Matrix | None, names: Sequence[str], before: np.ndarray
) -> np.ndarray:
    if isinstance(given, Mapping):
        matrix = before.copy()
        np.fill_diagonal(matrix, _per_joint("reduction", given, names, np.diag(before)))
    elif given is None:
        matrix = before
    else:
        values = _numbers("reduction", given)
        matrix = np.diag(values) if values.ndim == 1 else values
    if matrix.shape != before.shape:
        raise RobotDescriptionError(
            f"the reduction matrix has shape {matrix.shape}",
            advice=f"with {len(names)} moving joints {before.shape} is needed",
        )
    if (np.diag(matrix) == 0.0).any():
        joint = names[int(np.argmax(np.diag(matrix) == 0.0))]
        raise RobotDescriptionError(
            f"reduction of joint {joint!r} is 0",
            advice="give the motor's position per joint position",
        )
    return matrix


def _per_joint(
    key: str, given: PerJoint | None, names: Sequence[str], before: np.ndarray
) -> np.ndarray:
    """One finite number for each joint, from a sequence or from a mapping of some names."""
    if given is None:
        return before
    if isinstance(given, Mapping):
        values = np.array(before, dtype=float)
        for name, value in given.items():
            require_known(name, names, f"{key}: there is no joint {name!r}", RobotDescriptionError)
            values[list(names).index(name)] = _numbers(key, value)
    else:
        values = _numbers(key, given)
    if values.shape != (len(names),):
        raise RobotDescriptionError(
            f"{key} has shape {values.shape} for {len(names)} moving joints",
            advice="give one number for each",
        )
    if not np.isfinite(values).all():
        joint = names[int(np.argmin(np.isfinite(values)))]
        raise RobotDescriptionError(
            f"{key} of joint {joint!r} is not finite", advice="give a number"
        )
    return values


def _named(given: PerJoint | None, names: Sequence[str]) -> np.ndarray:
    """Which joints a quantity is given for."""
    if isinstance(given, Mapping):
        return np.array([name in given for name in names])
    return np.full(len(names), given is not None)


def _numbers(key: str, given: object) -> np.ndarray:
    try:
        return np.array(given, dtype=float)
    except (TypeError, ValueError) as error:
        raise RobotDescriptionError(f"{key} = {given!r} is not an array of numbers") from error
