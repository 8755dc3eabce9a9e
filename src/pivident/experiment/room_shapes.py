"""Shapes of the solids around a robot."""

from __future__ import annotations

from typing import Literal

ObstacleShape = Literal["box", "sphere", "cylinder", "capsule"]

SHAPES: tuple[ObstacleShape, ...] = ("box", "sphere", "cylinder", "capsule")
