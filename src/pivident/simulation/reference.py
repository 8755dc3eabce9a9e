"""Reference motions: point-to-point moves on quintic polynomials."""

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
