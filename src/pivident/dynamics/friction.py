"""Joint-side friction columns of whole signals; ``friction_kernels`` has them for one instant.

The codes are those of ``pivident.robot.friction``; ``shape`` is γ and then the term's constants,
such as v_s and δ of a Stribeck term.

Friction with a state (Dahl, LuGre, Maxwell slip) needs the path so far. Between two samples the
state is advanced by the exact solution over the travel, with the kernels of the simulator, so that
a column hardly depends on the sampling rate. Where the speed changes its sign between two samples,
the travel is split at the turning point of a motion of constant acceleration. The path starts
relaxed, z = 0.
"""

from __future__ import annotations

import numpy as np

from pivident.compiled import kernel
from pivident.dynamics.friction_kernels import level_and_slope, state_after_way, travel_to_reversal
from pivident.robot.friction import FrictionColumn
from pivident.robot.friction_term import OF_POSITION, WITH_MEMORY, SignFunction

_PRESLIDING = int(FrictionColumn.PRESLIDING)
_RATE = int(FrictionColumn.PRESLIDING_RATE)


@kernel
def _along(column, distance, excess, speed, exponent, period, q, dq, out):
    kind = _PRESLIDING if column == _RATE else column
    shape = (1.0 / distance, excess, 1.0 / speed if excess > 0.0 else 0.0, exponent)
    z, before, resting = 0.0, 1.0, 1.0 + excess
    for k in range(q.size):
        level, _ = level_and_slope(excess, shape[2], exponent, dq[k])
        if k > 0:
            start, travel = dq[k - 1], q[k] - q[k - 1]
            if start * dq[k] < 0.0:
                ahead = travel_to_reversal(start, dq[k], period)
                if (travel - ahead) * dq[k] > 0.0:
                    z = state_after_way(kind, z, start, before, 0.0, resting, ahead, *shape)
                    start, travel, before = 0.0, travel - ahead, resting
            z = state_after_way(kind, z, start, before, dq[k], level, travel, *shape)
        before = level
        out[k] = dq[k] - abs(dq[k]) * z / level if column == _RATE else z


def sampling_period(q: np.ndarray, dq: np.ndarray) -> float:
    """The period that positions and speeds agree on, Σ Δq v / Σ v² with v the mean speed [s]."""
    mean = 0.5 * (dq[1:] + dq[:-1])
    square = float(mean @ mean)
    return max(float(np.diff(q) @ mean) / square, 0.0) if square > 0.0 else 0.0


def memory_column(
    column: int, shape: tuple[float, ...], q: np.ndarray, dq: np.ndarray
) -> np.ndarray:
    """Column of a term with memory along a path at a constant rate, shape (samples,).

    It is z, or d dz/dt = dq - |dq| z/g for the rate; ``shape`` is γ (not used), d, ρ, v_s, δ.
    """
    q, dq = (np.ascontiguousarray(x, dtype=float) for x in (q, dq))
    out = np.empty(q.shape)
    _, distance, excess, speed, exponent = shape
    period = sampling_period(q, dq)
    _along(column, distance, excess, speed, exponent, period, q, dq, out)
    return out


def friction_column(
    column: int,
    sign: int,
    shape: tuple[float, ...],
    dq: np.ndarray,
    q: np.ndarray | None = None,
    load: np.ndarray | None = None,
) -> np.ndarray:
    """Column of one friction term, same shape as ``dq``; ``column`` and ``sign`` are codes.

    Terms of position need q, those with memory q along one path (samples,), those of load the
    torque that the joint carries [N m or N].
    """
    c = FrictionColumn
    if column in OF_POSITION or column in WITH_MEMORY:
        if q is None:
            raise ValueError(f"the term {FrictionColumn(column).name} needs the positions q")
        if column in OF_POSITION:
            return _position_column(column, shape, np.asarray(q, dtype=float))
        if np.shape(q) != dq.shape or dq.ndim != 1:
            raise ValueError(
                "terms with memory need q and dq along one path, each of shape (samples,), not "
                f"{np.shape(q)} and {dq.shape}"
            )
        return memory_column(column, shape, q, dq)
    if column == c.VISCOUS:
        return dq
    if column == c.VISCOUS_POSITIVE:
        return np.maximum(dq, 0.0)
    if column == c.VISCOUS_NEGATIVE:
        return np.minimum(dq, 0.0)
    if column == c.OFFSET:
        return np.ones_like(dq)
    if column == c.POWER:
        direction = np.sign(dq) if shape[1] >= 1.0 else smoothed_sign(sign, shape[0], dq)
        return direction * np.abs(dq) ** shape[1]
    s = smoothed_sign(sign, shape[0], dq)
    if column == c.COULOMB:
        return s
    if column == c.COULOMB_POSITIVE:
        return 0.5 * (1.0 + s)
    if column == c.COULOMB_NEGATIVE:
        return -0.5 * (1.0 - s)
    if column == c.LOAD:
        if load is None:
            raise ValueError("the term LOAD needs the torque that the joint carries")
        return np.abs(load) * s
    return s * np.exp(-(np.abs(dq / shape[1]) ** shape[2]))


def _position_column(column: int, shape: tuple[float, ...], q: np.ndarray) -> np.ndarray:
    """Ripple cos(n q), sin(n q), spring q, strut; see ``pivident.robot.friction``."""
    c = FrictionColumn
    if column == c.SPRING:
        return q
    if column == c.COSINE:
        return np.cos(shape[1] * q)
    if column == c.SINE:
        return np.sin(shape[1] * q)
    ratio, angle = shape[1], q - shape[2]
    if column == c.STRUT_STIFFNESS:
        return np.sin(angle)
    return np.sin(angle) / np.sqrt(1.0 + ratio**2 - 2.0 * ratio * np.cos(angle))


def smoothed_sign(sign: int, gamma: float, dq: np.ndarray) -> np.ndarray:
    """sign(dq), (2/π) atan(γ dq) or tanh(γ dq)."""
    if sign == SignFunction.SIGN:
        return np.sign(dq)
    if sign == SignFunction.ATAN:
        return (2.0 / np.pi) * np.arctan(gamma * dq)
    return np.tanh(gamma * dq)
