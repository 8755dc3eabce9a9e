"""Friction with a state, along a sampled path: presliding (Dahl, LuGre) and Maxwell slip.

Between two samples the state is advanced by the exact solution over the travel, with the kernels of
the simulator (see ``friction_kernels``), so that a column hardly depends on the sampling rate.
Where the speed changes its sign between two samples, the travel is split at the turning point of a
motion of constant acceleration. The path starts relaxed, z = 0.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from pivident.dynamics.friction_kernels import level_and_slope, state_after_way, travel_to_reversal
from pivident.robot.friction import FrictionColumn

_PRESLIDING = int(FrictionColumn.PRESLIDING)
_RATE = int(FrictionColumn.PRESLIDING_RATE)


@njit(cache=True, nogil=True, error_model="numpy")
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
