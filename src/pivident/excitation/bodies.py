"""The room that a robot takes: capsules."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, eq=False)
class Body:
    """A capsule: all points within a radius of a segment.

    Attributes:
        name: of the body, unique.
        link: index of the moving link that carries it, -1 for the fixed base.
        start: one end of the segment in the link's frame (base: the base frame) [m], shape (3,).
        end: its other end [m], shape (3,).
        radius: radius [m].
    """

    name: str
    link: int
    start: np.ndarray
    end: np.ndarray
    radius: float
