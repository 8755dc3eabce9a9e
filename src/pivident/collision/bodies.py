"""The room that a robot takes: a capsule for each body that moves, and for the base."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from pivident.errors import RobotDescriptionError

#: Name of the fixed link where the description gives it none.
BASE = "base"

#: How a body is given by hand, in messages.
BY_HAND = 'body = [{name = "forearm", link = "…", from = [x, y, z], to = [x, y, z], radius = r}]'


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

    def __post_init__(self) -> None:
        for key, value in (("start", self.start), ("end", self.end)):
            if np.shape(value) != (3,) or not np.isfinite(value).all():
                raise RobotDescriptionError(
                    f"body {self.name!r}: {key} = {value} must be three finite numbers in metres"
                )
        if not 0.0 < self.radius < np.inf:
            raise RobotDescriptionError(
                f"body {self.name!r}: radius = {self.radius} must be positive, in metres"
            )


@dataclass(frozen=True)
class Outline:
    """The bodies of a robot, and where they come from.

    Attributes:
        bodies: capsules, those of the base first, links in order.
        source: ``urdf``, ``gallery`` or ``skeleton``; ``given`` where the caller gave all of them.
        remarks: what a user should know of them, complete sentences.
        given: links whose bodies the caller gave.
    """

    bodies: tuple[Body, ...]
    source: Literal["urdf", "gallery", "skeleton", "given"]
    remarks: tuple[str, ...] = ()
    given: tuple[int, ...] = ()


def numbered(name: str, count: int) -> list[str]:
    """Names of so many bodies of one link: its own, numbered where there are several."""
    return [name] if count == 1 else [f"{name} ({k + 1})" for k in range(count)]
