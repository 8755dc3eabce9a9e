"""Joint-side friction columns of whole signals; ``friction_kernels`` has them for one instant.

The codes are those of ``pivident.robot.friction``; ``shape`` is γ and then the term's constants,
such as v_s and δ of a Stribeck term.
"""

from __future__ import annotations

import numpy as np

from pivident.dynamics.friction_memory import memory_column
from pivident.robot.friction import FrictionColumn, FrictionLaw, SignFunction

_VISCOUS = int(FrictionColumn.VISCOUS)
_COULOMB = int(FrictionColumn.COULOMB)
_OFFSET = int(FrictionColumn.OFFSET)
_POSITIVE = int(FrictionColumn.COULOMB_POSITIVE)
_NEGATIVE = int(FrictionColumn.COULOMB_NEGATIVE)
_STRIBECK = int(FrictionColumn.STRIBECK)
_POWER = int(FrictionColumn.POWER)
_FORWARDS = int(FrictionColumn.VISCOUS_POSITIVE)
_BACKWARDS = int(FrictionColumn.VISCOUS_NEGATIVE)
_COSINE, _SINE = int(FrictionColumn.COSINE), int(FrictionColumn.SINE)
_SPRING = int(FrictionColumn.SPRING)
_STRUT = int(FrictionColumn.STRUT)
_STRUT_STIFFNESS = int(FrictionColumn.STRUT_STIFFNESS)
_LOAD = int(FrictionColumn.LOAD)
_OF_POSITION = (_COSINE, _SINE, _SPRING, _STRUT, _STRUT_STIFFNESS)
_WITH_MEMORY = (
    int(FrictionColumn.PRESLIDING),
    int(FrictionColumn.PRESLIDING_RATE),
    int(FrictionColumn.MAXWELL),
)
_SIGN, _ATAN = int(SignFunction.SIGN), int(SignFunction.ATAN)


def friction_column(
    column: int,
    sign: int,
    shape: tuple[float, ...],
    dq: np.ndarray,
    q: np.ndarray | None = None,
    load: np.ndarray | None = None,
) -> np.ndarray:
    """Column of one friction term for a whole signal, same shape as ``dq``.

    Args:
        column: code of the term's function.
        sign: code of the smoothed sign function.
        shape: slope γ [s/rad or s/m], then the term's constants.
        dq: joint speed [rad/s or m/s].
        q: joint position [rad or m], for terms of position; for terms with memory a path in
            time, shape (samples,).
        load: torque that the joint carries [N m or N], for terms of load.

    Raises:
        ValueError: position or load is missing, or a path has no single time axis.
    """
    if column in _OF_POSITION or column in _WITH_MEMORY:
        if q is None:
            raise ValueError(f"the term {FrictionColumn(column).name} needs the positions q")
        if column in _OF_POSITION:
            return _position_column(column, shape, np.asarray(q, dtype=float))
        if np.shape(q) != dq.shape or dq.ndim != 1:
            raise ValueError(
                "terms with memory need q and dq along one path, each of shape (samples,), not "
                f"{np.shape(q)} and {dq.shape}"
            )
        return memory_column(column, shape, q, dq)
    if column == _VISCOUS:
        return dq
    if column == _FORWARDS:
        return np.maximum(dq, 0.0)
    if column == _BACKWARDS:
        return np.minimum(dq, 0.0)
    if column == _OFFSET:
        return np.ones_like(dq)
    if column == _POWER:
        direction = np.sign(dq) if shape[1] >= 1.0 else smoothed_sign(sign, shape[0], dq)
        return direction * np.abs(dq) ** shape[1]
    s = smoothed_sign(sign, shape[0], dq)
    if column == _COULOMB:
        return s
    if column == _POSITIVE:
        return 0.5 * (1.0 + s)
    if column == _NEGATIVE:
        return -0.5 * (1.0 - s)
    if column == _LOAD:
        if load is None:
            raise ValueError("the term LOAD needs the torque that the joint carries")
        return np.abs(load) * s
    return s * np.exp(-(np.abs(dq / shape[1]) ** shape[2]))


def _position_column(column: int, shape: tuple[float, ...], q: np.ndarray) -> np.ndarray:
    """Ripple cos(n q), sin(n q), spring q, strut; see ``pivident.robot.friction``."""
    if column == _SPRING:
        return q
    if column == _COSINE:
        return np.cos(shape[1] * q)
    if column == _SINE:
        return np.sin(shape[1] * q)
    ratio, angle = shape[1], q - shape[2]
    if column == _STRUT_STIFFNESS:
        return np.sin(angle)
    return np.sin(angle) / np.sqrt(1.0 + ratio**2 - 2.0 * ratio * np.cos(angle))


def smoothed_sign(sign: int, gamma: float, dq: np.ndarray) -> np.ndarray:
    """sign(dq), (2/π) atan(γ dq) or tanh(γ dq)."""
    if sign == _SIGN:
        return np.sign(dq)
    if sign == _ATAN:
        return (2.0 / np.pi) * np.arctan(gamma * dq)
    return np.tanh(gamma * dq)


def friction_columns(
    law: FrictionLaw,
    dq: np.ndarray,
    q: np.ndarray | None = None,
    load: np.ndarray | None = None,
    *,
    simulated: bool = False,
) -> np.ndarray:
    """Columns of the law: shape ``dq.shape + (terms,)``.

    Args:
        law: the joint's friction law.
        dq: joint speed [rad/s or m/s], any shape; shape (samples,) where terms have memory,
            which starts relaxed.
        q: joint position [rad or m], likewise; terms of position and with memory need it.
        load: torque that the joint carries [N m or N], likewise; load-dependent ones need it.
        simulated: replace the hard sign by its smooth form, as the simulator does.

    Raises:
        ValueError: a term needs position or load, and they are not given.
    """
    dq = np.asarray(dq, dtype=float)
    out = np.empty((*dq.shape, len(law.terms)))
    for k, term in enumerate(law.terms):
        column, sign, shape = term.encoded(simulated)
        out[..., k] = friction_column(column, sign, shape, dq, q, load)
    return out
