"""The moving picture of a design: robot, bodies and obstacles as plain values for a script."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from pivident.collision.obstacles import Obstacle
from pivident.excitation.design import Design
from pivident.excitation.design_figures import MOTION
from pivident.report.motion import RATE, motion_values

#: Digits of lengths [m].
_DIGITS = 5


@dataclass(frozen=True, eq=False)
class _Positions:
    """What the picture of a recording reads of it."""

    name: str
    t: np.ndarray
    q_measured: np.ndarray


def picture_values(design: Design) -> dict[str, Any]:
    """Robot and motion as `motion_values` has them, with ``bodies`` and ``obstacles``.

    ``bodies``: link, start and end in the link's frame, and radius of each capsule; ``obstacles``:
    shape, size, radius, length, rotation by rows and translation of each. All lengths in m.

    Args:
        design: the design.
    """
    motion = design.motion
    t = np.linspace(0.0, motion.duration, max(2, int(np.ceil(motion.duration * RATE)) + 1))
    positions: Any = _Positions(MOTION, t, motion.at(t)[0])
    content = motion_values(design.robot, [positions])
    content["bodies"] = [
        {
            "link": int(body.link),
            "start": _rounded(body.start),
            "end": _rounded(body.end),
            "radius": round(float(body.radius), _DIGITS),
        }
        for body in design.bodies
    ]
    content["obstacles"] = [_obstacle(obstacle) for obstacle in design.obstacles]
    return content


def _obstacle(obstacle: Obstacle) -> dict[str, Any]:
    """One obstacle with all sizes that its shape needs, and its pose."""
    return {
        "name": obstacle.name,
        "shape": obstacle.shape,
        "size": _rounded((0.0, 0.0, 0.0) if obstacle.size is None else obstacle.size),
        "radius": round(obstacle.radius, _DIGITS),
        "length": round(obstacle.length, _DIGITS),
        "rotation": [round(float(x), 9) for x in np.ravel(obstacle.rotation)],
        "translation": _rounded(obstacle.translation),
    }


def _rounded(vector: Any) -> list[float]:
    return [round(float(x), _DIGITS) for x in np.asarray(vector, dtype=float)]
