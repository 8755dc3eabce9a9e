"""Friction with a state, along a sampled path: presliding (Dahl, LuGre) and Maxwell slip.

Between two samples the joint goes Δq, and the state is advanced by the exact solution over that
distance, so that a column hardly depends on the sampling rate:

    presliding    z ← s g + (z - s g) exp(-u),   s = sign(Δq),   u = |Δq|/(d g)
    Maxwell slip  z ← min(max(z + Δq/d, -g), g)

with g = 1 + ρ exp(-|dq/v_s|^δ), the level to which the friction falls with speed (Stribeck).
Where g changes from g₀ to g₁ on the way, presliding takes it as linear along the travel,

    z ← s g₁ + (z - s g₀) exp(-u) - s (g₁ - g₀) (1 - exp(-u))/u

with the mean of both in u. Where the speed changes its sign between two samples, the way out, up
to the turning point of a motion of constant acceleration, and the way back are gone one after the
other. The path starts relaxed, z = 0.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from pivident.robot.friction import FrictionColumn

_RATE = int(FrictionColumn.PRESLIDING_RATE)
_MAXWELL = int(FrictionColumn.MAXWELL)


@njit(cache=True, nogil=True, error_model="numpy", forceinline=True)
def stribeck_level(dq, excess, speed, exponent):
    """Level g = 1 + ρ exp(-|dq/v_s|^δ) over Coulomb friction; 1 where there is no excess ρ."""
    if excess == 0.0:
        return 1.0
    return 1.0 + excess * math.exp(-(abs(dq / speed) ** exponent))


@njit(cache=True, nogil=True, error_model="numpy", forceinline=True)
def presliding_step(z, travel, before, level, distance):
    """State after ``travel`` in one direction, on which g goes from ``before`` to ``level``."""
    steps = abs(travel) / (distance * 0.5 * (before + level))
    if steps == 0.0:
        return z
    direction = math.copysign(1.0, travel)
    rest = math.exp(-steps)
    lag = (level - before) * -math.expm1(-steps) / steps
    return direction * (level - lag) + (z - direction * before) * rest


@njit(cache=True, nogil=True, error_model="numpy", forceinline=True)
def slip_step(z, travel, level, distance):
    """State of an element that sticks until its level is reached, after ``travel``."""
    return min(max(z + travel / distance, -level), level)


@njit(cache=True, nogil=True, error_model="numpy", forceinline=True)
def _step(column, z, travel, before, level, distance):
    if column == _MAXWELL:
        return slip_step(z, travel, level, distance)
    return presliding_step(z, travel, before, level, distance)


@njit(cache=True, nogil=True, error_model="numpy")
def _along(column, distance, excess, speed, exponent, period, q, dq, out):
    z, before, resting = 0.0, 1.0, 1.0 + excess
    for k in range(q.size):
        level = stribeck_level(dq[k], excess, speed, exponent)
        if k > 0:
            travel = q[k] - q[k - 1]
            if dq[k - 1] * dq[k] < 0.0:
                ahead = 0.5 * dq[k - 1] ** 2 * period / (dq[k - 1] - dq[k])
                if (travel - ahead) * dq[k] > 0.0:
                    z = _step(column, z, ahead, before, resting, distance)
                    travel, before = travel - ahead, resting
            z = _step(column, z, travel, before, level, distance)
        before = level
        out[k] = dq[k] - abs(dq[k]) * z / level if column == _RATE else z


def sampling_period(q: np.ndarray, dq: np.ndarray) -> float:
    """The period that positions and speeds agree on, Σ Δq v / Σ v² with v the mean speed [s].

    Args:
        q: positions at a constant rate [rad or m], shape (samples,).
        dq: speeds [rad/s or m/s], likewise.
    """
    mean = 0.5 * (dq[1:] + dq[:-1])
    square = float(mean @ mean)
    return max(float(np.diff(q) @ mean) / square, 0.0) if square > 0.0 else 0.0


def memory_column(
    column: int, shape: tuple[float, ...], q: np.ndarray, dq: np.ndarray
) -> np.ndarray:
    """Column of a term with memory along one joint's path, shape (samples,).

    Args:
        column: code of the term's function; z, or d dz/dt = dq - |dq| z/g for the rate.
        shape: γ (not used), presliding distance d [rad or m], ρ, v_s [rad/s or m/s], δ.
        q: joint positions at a constant rate [rad or m], shape (samples,).
        dq: joint speeds [rad/s or m/s], likewise.
    """
    q, dq = (np.ascontiguousarray(x, dtype=float) for x in (q, dq))
    out = np.empty(q.shape)
    _, distance, excess, speed, exponent = shape
    period = sampling_period(q, dq)
    _along(column, distance, excess, speed, exponent, period, q, dq, out)
    return out
