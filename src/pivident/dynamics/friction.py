"""Joint-side friction columns f(dq) and their slopes: NumPy for signals, numba for the simulator.

The codes are those of ``pivident.robot.friction``; ``shape`` is (γ, v_s, δ).
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from pivident.dynamics.elementary import arctangent
from pivident.robot.friction import FrictionColumn, SignFunction

_VISCOUS = int(FrictionColumn.VISCOUS)
_COULOMB = int(FrictionColumn.COULOMB)
_OFFSET = int(FrictionColumn.OFFSET)
_POSITIVE = int(FrictionColumn.COULOMB_POSITIVE)
_NEGATIVE = int(FrictionColumn.COULOMB_NEGATIVE)
_STRIBECK = int(FrictionColumn.STRIBECK)
_SIGN, _ATAN = int(SignFunction.SIGN), int(SignFunction.ATAN)


def friction_column(
    column: int, sign: int, shape: tuple[float, float, float], dq: np.ndarray
) -> np.ndarray:
    """f(dq) of one friction term for a whole signal, same shape as ``dq``.

    Args:
        column: code of the term's function.
        sign: code of the smoothed sign function.
        shape: slope γ [s/rad or s/m], Stribeck speed [rad/s or m/s], Stribeck exponent.
        dq: joint speed [rad/s or m/s].
    """
    if column == _VISCOUS:
        return dq
    if column == _OFFSET:
        return np.ones_like(dq)
    s = smoothed_sign(sign, shape[0], dq)
    if column == _COULOMB:
        return s
    if column == _POSITIVE:
        return 0.5 * (1.0 + s)
    if column == _NEGATIVE:
        return -0.5 * (1.0 - s)
    return s * np.exp(-(np.abs(dq / shape[1]) ** shape[2]))


def smoothed_sign(sign: int, gamma: float, dq: np.ndarray) -> np.ndarray:
    """sign(dq), (2/π) atan(γ dq) or tanh(γ dq)."""
    if sign == _SIGN:
        return np.sign(dq)
    if sign == _ATAN:
        return (2.0 / np.pi) * np.arctan(gamma * dq)
    return np.tanh(gamma * dq)


@njit(cache=True, nogil=True, error_model="numpy", forceinline=True)
def smooth_sign_and_slope(sign, gamma, v):
    """Smoothed sign at one speed and its slope there (the hard sign is not simulated)."""
    x = gamma * v
    if sign == _ATAN:
        return 2.0 / math.pi * arctangent(x), 2.0 / math.pi * gamma / (1.0 + x * x)
    s = math.tanh(x)
    return s, gamma * (1.0 - s * s)


@njit(cache=True, nogil=True, error_model="numpy", forceinline=True)
def friction_value_and_slope(column, sign, gamma, speed, exponent, v):
    """f(v) of one nonlinear friction term and df/dv, scalars."""
    s, slope = smooth_sign_and_slope(sign, gamma, v)
    if column == _COULOMB:
        return s, slope
    if column == _POSITIVE:
        return 0.5 * (1.0 + s), 0.5 * slope
    if column == _NEGATIVE:
        return -0.5 * (1.0 - s), 0.5 * slope
    ratio = abs(v / speed) ** exponent
    fall = math.exp(-ratio)
    decline = 0.0 if v == 0.0 else -s * fall * exponent * ratio / v
    return s * fall, slope * fall + decline
