"""Reference motions: moves between postures, on quintic polynomials or with trapezoidal speeds."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np

#: The way from a posture, speeds and accelerations, each (samples, joints).
Stretch = tuple[np.ndarray, np.ndarray, np.ndarray]

#: A move over its time as a share of its duration, shape (samples,).
Profile = Callable[[np.ndarray], Stretch]

#: Peak speed of a quintic rest-to-rest move of unit length and duration.
QUINTIC_PEAK = 1.875


def point_to_point(
    postures: np.ndarray, speeds: np.ndarray, rate: float, samples: int, dwell: float = 0.05
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Synchronised rest-to-rest moves through postures, s(x) = 10x³ - 15x⁴ + 6x⁵.

    Every move lasts as long as its slowest joint needs at its largest speed; the joints rest for
    ``dwell`` at each posture. After the last posture the robot stays there.

    ``postures``: joint positions to pass, shape (postures, joints) [rad or m]; ``speeds``: largest
    speed of each joint, shape (joints,) [rad/s or m/s]; ``dwell``: rest at each posture [s].
    Result: q, dq, ddq of the reference, each (samples, joints).
    """

    def quintic(way: np.ndarray) -> tuple[float, Profile]:
        duration = max(float((QUINTIC_PEAK * np.abs(way) / speeds).max()), 1.0 / rate)

        def profile(x: np.ndarray) -> Stretch:
            x = x[:, None]
            return (
                way * x**3 * (10 - 15 * x + 6 * x**2),
                way / duration * 30 * x**2 * (1 - x) ** 2,
                way / duration**2 * 60 * x * (1 - x) * (1 - 2 * x),
            )

        return duration, profile

    return _moves(postures, quintic, rate, samples, dwell)


def trapezoidal_moves(
    postures: np.ndarray,
    speeds: np.ndarray,
    accelerations: np.ndarray,
    rate: float,
    samples: int,
    dwell: float = 0.05,
    edge: float = 0.25,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Synchronised moves as industrial controllers plan them: smoothed bang-bang accelerations.

    All joints accelerate for T_a, keep their speeds, and brake for T_a. The acceleration rises and
    falls linearly over a share e of T_a, so that a joint on its way s has the largest

        speed s/D,    acceleration s/(D T_a (1 - e)),    D = T - T_a

    T is the shortest with which no joint exceeds its limits. After the last posture the robot stays
    there.

    Args:
        postures: joint positions to pass, shape (postures, joints) [rad or m].
        speeds: largest speed of each joint, shape (joints,) [rad/s or m/s].
        accelerations: largest acceleration of each joint, shape (joints,) [rad/s² or m/s²].
        rate: sampling rate [Hz].
        samples: length of the motion.
        dwell: rest at each posture [s].
        edge: e, share of T_a in which the acceleration rises, and in which it falls.

    Returns:
        q, dq, ddq of the reference, each (samples, joints).
    """

    def trapezoid(way: np.ndarray) -> tuple[float, Profile]:
        slowest = float((np.abs(way) / speeds).max())
        product = float((np.abs(way) / accelerations).max()) / (1.0 - edge)
        cruise = max(slowest, float(np.sqrt(product)), 1.0 / rate)  # D
        rise = max(product / cruise, 1e-9)  # T_a
        duration = cruise + rise

        def profile(x: np.ndarray) -> Stretch:
            share, speed, acceleration, _ = trapezoidal_move(x * duration, rise, cruise, edge)
            return np.outer(share, way), np.outer(speed, way), np.outer(acceleration, way)

        return duration, profile

    return _moves(postures, trapezoid, rate, samples, dwell)


def _moves(
    postures: np.ndarray,
    plan: Callable[[np.ndarray], tuple[float, Profile]],
    rate: float,
    samples: int,
    dwell: float,
) -> Stretch:
    """Moves from posture to posture; ``plan``: duration [s] and profile of a way."""
    q, dq, ddq = (np.zeros((samples, postures.shape[1])) for _ in range(3))
    t = np.arange(samples) / rate
    start = 0.0
    q[:] = postures[0]
    for here, there in pairwise(postures):
        duration, profile = plan(there - here)
        x = (t - start) / duration
        moving = (x >= 0) & (x < 1)
        way, dq[moving], ddq[moving] = profile(x[moving])
        q[moving] = here + way
        q[t >= start + duration] = there
        start += duration + dwell
    return q, dq, ddq


def trapezoidal_move(t: np.ndarray, rise: float, cruise: float, edge: float = 0.25) -> np.ndarray:
    """Share of the way of a trapezoidal move, its speed, acceleration and jerk: (4, samples).

    It is a ramp up at 0 less one at D, over D.

    ``t``: time since the move began [s]; ``rise``: T_a [s]; ``cruise``: D, the duration less T_a
    [s]; ``edge``: as for `trapezoidal_moves`.
    """
    up, down = _ramp(t / rise, edge), _ramp((t - cruise) / rise, edge)
    scales = np.array([rise, 1.0, 1.0 / rise, 1.0 / rise**2]) / cruise
    return scales[:, None] * (up - down)


def _ramp(x: np.ndarray, edge: float) -> np.ndarray:
    """A speed that goes from 0 to 1 while x does: its integral, itself, and two derivatives."""
    inside = np.clip(x, 0.0, 1.0)
    near = np.minimum(inside, 1.0 - inside)  # the second half is the first one turned
    flat = np.maximum(near - edge, 0.0)
    rising = np.minimum(near, edge)
    height = 1.0 / (1.0 - edge)
    slope = height * np.minimum(near / edge, 1.0)
    speed = height * (rising**2 / (2.0 * edge) + flat)
    way = height * (rising**3 / (6.0 * edge) + edge * flat / 2.0 + flat**2 / 2.0)
    late = inside > 0.5
    bend = np.where((x > 0.0) & (x < 1.0) & (near < edge), height / edge, 0.0)
    speed = np.where(late, 1.0 - speed, speed)
    way = np.where(late, inside - 0.5 + way, way) + np.maximum(x - 1.0, 0.0)
    return np.stack([way, speed, slope, np.where(late, -bend, bend)])
