"""Reference motions: moves between postures, on quintic polynomials or with trapezoidal speeds."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

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
    q, dq, ddq = (np.zeros((samples, postures.shape[1])) for _ in range(3))
    t = np.arange(samples) / rate
    start = 0.0
    q[:] = postures[0]
    for here, there in pairwise(postures):
        way = there - here
        duration = max(float((QUINTIC_PEAK * np.abs(way) / speeds).max()), 1.0 / rate)
        x = ((t - start) / duration)[:, None]
        moving = (x[:, 0] >= 0) & (x[:, 0] < 1)
        x = x[moving]
        q[moving] = here + way * x**3 * (10 - 15 * x + 6 * x**2)
        dq[moving] = way / duration * 30 * x**2 * (1 - x) ** 2
        ddq[moving] = way / duration**2 * 60 * x * (1 - x) * (1 - 2 * x)
        q[t >= start + duration] = there
        start += duration + dwell
    return q, dq, ddq


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
    q, dq, ddq = (np.zeros((samples, postures.shape[1])) for _ in range(3))
    t = np.arange(samples) / rate
    start = 0.0
    q[:] = postures[0]
    for here, there in pairwise(postures):
        way = there - here
        slowest = float((np.abs(way) / speeds).max())
        product = float((np.abs(way) / accelerations).max()) / (1.0 - edge)
        cruise = max(slowest, float(np.sqrt(product)), 1.0 / rate)  # D
        rise = max(product / cruise, 1e-9)  # T_a
        moving = (t >= start) & (t < start + cruise + rise)
        share, speed, acceleration = _trapezoid(t[moving] - start, rise, cruise, edge)
        q[moving] = here + np.outer(share, way)
        dq[moving] = np.outer(speed, way)
        ddq[moving] = np.outer(acceleration, way)
        start += cruise + rise
        q[t >= start] = there
        start += dwell
    return q, dq, ddq


def _trapezoid(
    t: np.ndarray, rise: float, cruise: float, edge: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Share of the way, its speed and acceleration: a ramp up at 0 less one at D, over D."""
    up, down = _ramp(t / rise, edge), _ramp((t - cruise) / rise, edge)
    scales = rise, 1.0, 1.0 / rise
    way, speed, acceleration = (
        scale * (a - b) / cruise for scale, a, b in zip(scales, up, down, strict=True)
    )
    return way, speed, acceleration


def _ramp(x: np.ndarray, edge: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A speed that goes from 0 to 1 while x does, its integral, and its slope, a trapezoid."""
    inside = np.clip(x, 0.0, 1.0)
    near = np.minimum(inside, 1.0 - inside)  # the second half is the first one turned
    flat = np.maximum(near - edge, 0.0)
    rising = np.minimum(near, edge)
    height = 1.0 / (1.0 - edge)
    slope = height * np.minimum(near / edge, 1.0)
    speed = height * (rising**2 / (2.0 * edge) + flat)
    way = height * (rising**3 / (6.0 * edge) + edge * flat / 2.0 + flat**2 / 2.0)
    late = inside > 0.5
    speed = np.where(late, 1.0 - speed, speed)
    way = np.where(late, inside - 0.5 + way, way) + np.maximum(x - 1.0, 0.0)
    return way, speed, slope
