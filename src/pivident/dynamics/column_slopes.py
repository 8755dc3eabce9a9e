"""Slopes of columns that depend on the motion of one joint or two: rotor, friction, coupling."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from pivident.dynamics.entry_plan import coupling_sign, has_inner_signal
from pivident.dynamics.friction import smoothed_sign
from pivident.dynamics.parameters import Parameter
from pivident.dynamics.regressor import Regressor
from pivident.robot.description import Robot
from pivident.robot.friction import FrictionColumn
from pivident.robot.friction_term import SignFunction

#: A slope from the joint's position and speed, and the speed of the other joint.
Slope = Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]


@dataclass(frozen=True, eq=False)
class ColumnSlope:
    """How a column changes with the motion of a joint."""

    joint: int  # row of the observation matrix
    column: int  # parameter
    motion_of: int  # joint on whose motion it depends
    quantity: int  # 0 position, 1 speed, 2 acceleration
    value: Slope
    other: int  # a second joint that it depends on; the first one where there is none
    ratio: float = 0.0  # its share: the slope by the second joint over that by the first


def column_slopes(regressor: Regressor) -> tuple[ColumnSlope, ...]:
    """Slopes of all columns without inertial parameter that have one."""
    found = []
    for j, c in zip(regressor.row.tolist(), regressor.column.tolist(), strict=True):
        p = regressor.parameters[c]
        if not p.is_inertial and not has_inner_signal(p):
            slope = _slope(regressor.robot, p, j, c)
            found += [] if slope is None else [slope]
    return tuple(found)


def _slope(robot: Robot, p: Parameter, joint: int, column: int) -> ColumnSlope | None:
    """Slope of one entry; None for a constant one."""
    if p.friction is not None:
        quantity, value = _friction_slope(*p.friction.encoded())
        return value and ColumnSlope(joint, column, joint, quantity, value, joint)
    if p.coupling is None:  # a rotor
        return ColumnSlope(joint, column, joint, 2, _constant(1.0), joint)
    c = p.coupling
    if p.stem == "fcm":
        sign, gamma = coupling_sign(robot, c.motor)
        factor = c.ratio if joint == c.joint else 1.0

        def coulomb(q: np.ndarray, dq: np.ndarray, other: np.ndarray) -> np.ndarray:
            return factor * sign_slope(sign, gamma, dq + c.ratio * other)

        return ColumnSlope(joint, column, c.motor, 1, coulomb, c.joint, c.ratio)
    moved = c.motor if joint == c.joint else c.joint
    quantity = 2 if p.stem == "iam" else 1
    return ColumnSlope(joint, column, moved, quantity, _constant(c.ratio), moved)


def _constant(value: float) -> Slope:
    return lambda q, dq, other: np.full(q.shape, value)


def _friction_slope(column: int, sign: int, shape: tuple[float, ...]) -> tuple[int, Slope | None]:
    """Quantity that a friction column depends on, and its slope; see ``dynamics.friction``."""
    c = FrictionColumn
    gamma = shape[0] if shape else 0.0
    if column == c.OFFSET:
        return 1, None
    if column == c.VISCOUS:
        return 1, _constant(1.0)
    if column in (c.SPRING, c.COSINE, c.SINE, c.STRUT, c.STRUT_STIFFNESS):
        return 0, lambda q, dq, other: _position_slope(column, shape, q)
    if column == c.VISCOUS_POSITIVE:
        return 1, lambda q, dq, other: (dq > 0.0).astype(float)
    if column == c.VISCOUS_NEGATIVE:
        return 1, lambda q, dq, other: (dq < 0.0).astype(float)
    if column == c.POWER:
        return 1, lambda q, dq, other: _power_slope(sign, gamma, shape[1], dq)
    if column == c.STRIBECK:
        return 1, lambda q, dq, other: _stribeck_slope(sign, gamma, shape[1], shape[2], dq)
    half = 1.0 if column == c.COULOMB else 0.5
    return 1, lambda q, dq, other: half * sign_slope(sign, gamma, dq)


def sign_slope(sign: int, gamma: float, dq: np.ndarray) -> np.ndarray:
    """Slope of sign(dq), (2/π) atan(γ dq) or tanh(γ dq)."""
    if sign == SignFunction.SIGN:
        return np.zeros(dq.shape)
    if sign == SignFunction.ATAN:
        return 2.0 / np.pi * gamma / (1.0 + (gamma * dq) ** 2)
    return gamma * (1.0 - np.tanh(gamma * dq) ** 2)


def _power_slope(sign: int, gamma: float, exponent: float, dq: np.ndarray) -> np.ndarray:
    """Slope of s(dq) |dq|^p, s the hard sign from p = 1 on."""
    size = np.maximum(np.abs(dq), 1e-300)
    if exponent >= 1.0:
        return exponent * size ** (exponent - 1.0)
    # |dq|^(p-1) grows without bound at rest, where the smoothed sign takes it to zero
    rising = sign_slope(sign, gamma, dq) * size**exponent
    direction = smoothed_sign(sign, gamma, dq) * np.sign(dq)
    return rising + np.where(dq == 0.0, 0.0, direction * exponent * size ** (exponent - 1.0))


def _stribeck_slope(
    sign: int, gamma: float, speed: float, exponent: float, dq: np.ndarray
) -> np.ndarray:
    """Slope of s(dq) exp(-|dq/v|^δ)."""
    ratio = np.abs(dq / speed) ** exponent
    size = np.where(dq == 0.0, 1.0, np.abs(dq))
    fall = -exponent * ratio / size * np.sign(dq)
    return np.exp(-ratio) * (sign_slope(sign, gamma, dq) + smoothed_sign(sign, gamma, dq) * fall)


def _position_slope(column: int, shape: tuple[float, ...], q: np.ndarray) -> np.ndarray:
    """Slopes of ripple, spring and strut."""
    c = FrictionColumn
    if column == c.SPRING:
        return np.ones(q.shape)
    if column == c.COSINE:
        return -shape[1] * np.sin(shape[1] * q)
    if column == c.SINE:
        return shape[1] * np.cos(shape[1] * q)
    ratio, angle = shape[1], q - shape[2]
    if column == c.STRUT_STIFFNESS:
        return np.cos(angle)
    square = 1.0 + ratio**2 - 2.0 * ratio * np.cos(angle)
    return np.cos(angle) / np.sqrt(square) - ratio * np.sin(angle) ** 2 / square**1.5
