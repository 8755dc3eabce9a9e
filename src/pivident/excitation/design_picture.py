"""The moving picture of a design: robot, bodies and obstacles as plain values for a script."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

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
    content["obstacles"] = [_obstacle(obstacle.plain()) for obstacle in design.obstacles]
    return content


def _obstacle(values: Mapping[str, Any]) -> dict[str, Any]:
    """One obstacle with all sizes that its shape needs, and its pose."""
    pose = values.get("pose") or values
    rotation, translation = pose.get("rotation"), pose.get("translation")
    size = values.get("size")
    return {
        "name": str(values.get("name", "")),
        "shape": str(values["shape"]),
        "size": _rounded((0.0, 0.0, 0.0) if size is None else size),
        "radius": round(float(values.get("radius") or 0.0), _DIGITS),
        "length": round(float(values.get("length") or 0.0), _DIGITS),
        "rotation": [
            round(float(x), 9)
            for x in np.ravel(np.eye(3) if rotation is None else np.asarray(rotation))
        ],
        "translation": _rounded((0.0, 0.0, 0.0) if translation is None else translation),
    }


def _rounded(vector: Any) -> list[float]:
    return [round(float(x), _DIGITS) for x in np.asarray(vector, dtype=float)]
