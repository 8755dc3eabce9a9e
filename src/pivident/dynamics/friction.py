"""Joint-side friction columns f(dq) and their slopes: NumPy for signals, numba for the simulator.

The codes are those of ``pivident.robot.friction``; ``shape`` is (γ, v_s, δ).
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

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
def arctangent(x):
    """atan(x) to rounding, five times as fast as libm's: no branch to mispredict.

    Rational approximation of Cephes (Moshier, Methods and Programs for Mathematical Functions,
    1989) after reduction to |x| < 0.66.
    """
    a = abs(x)
    large, middle = a > 2.414213562373095, a > 0.66
    numerator = -1.0 if large else (a - 1.0 if middle else a)
    denominator = a if large else (a + 1.0 if middle else 1.0)
    start = 0.5 * math.pi if large else (0.25 * math.pi if middle else 0.0)
    y = numerator / denominator
    z = y * y
    p = -8.750608600031904122785e-1 * z - 1.615753718733365076637e1
    p = ((p * z - 7.500855792314704667340e1) * z - 1.228866684490136173410e2) * z
    p = p - 6.485021904942025371773e1
    q = (z + 2.485846490142306297962e1) * z + 1.650270098316988542046e2
    q = ((q * z + 4.328810604912902668951e2) * z + 4.853903996359136964868e2) * z
    q = q + 1.945506571482613964425e2
    return math.copysign(start + (y + y * z * p / q), x)


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
