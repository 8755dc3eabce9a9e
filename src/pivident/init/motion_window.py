"""When the joints move."""

from __future__ import annotations

import numpy as np

#: Travel within 0.1 s that is none, as share of a joint's fastest.
SLOW = 0.02

#: Share of a joint's path before its motion begins and after it has ended.
CREEP = 0.005


def motion_window(q: np.ndarray, seconds: np.ndarray) -> tuple[float, float, float]:
    """First and last time of motion, but for `CREEP` at both ends, and the share of rest."""
    step = max(1, round(0.1 * (len(q) - 1) / max(float(seconds[-1] - seconds[0]), 1e-9)))
    if step >= len(q):
        return float(seconds[0]), float(seconds[-1]), 0.0
    travel = np.abs(q[step:] - q[:-step])
    moving = travel > SLOW * np.quantile(travel, 0.995, axis=0) + 1e-12
    path = np.cumsum(np.where(moving, travel, 0.0), axis=0)
    if not path[-1].any():
        return float(seconds[0]), float(seconds[-1]), 1.0
    share = path[:, path[-1] > 0] / path[-1, path[-1] > 0]
    first = int(np.argmax((share > CREEP).any(axis=1)))
    last = int(np.argmax((share >= 1.0 - CREEP).all(axis=1)))
    still = 1.0 - float(moving[first : last + 1].any(axis=1).mean())
    return float(seconds[first]), float(seconds[last + step]), still
