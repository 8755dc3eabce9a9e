"""Contacts that hold a point of a link where it is: feet that stand."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from pivident.errors import RobotDescriptionError


@dataclass(frozen=True, eq=False)
class Contact:
    """A point of a link that does not move in the world, and may not be pulled away from it.

    Attributes:
        link: the link, by its own name or that of its joint.
        point: the point in the frame of the link, shape (3,) [m].
    """

    link: str
    point: np.ndarray = field(default_factory=lambda: np.zeros(3))

    def __post_init__(self) -> None:
        if np.shape(self.point) != (3,) or not np.isfinite(self.point).all():
            raise RobotDescriptionError(
                f"contact of {self.link!r}: its point is {self.point}; three finite numbers in m "
                "are needed"
            )
