"""What closes the loops of a mechanism: frames that meet, and joints that move in proportion.

Cut its loops, and a mechanism is a tree with more joints than it has degrees of freedom. The
equations c(q) = 0 say what the cuts have taken away. With A = ∂c/∂q, the chosen *independent*
joints q_a move all others,

    dq = N dq_a,    A N = 0,    ddq = N ddq_a + γ(q, dq)

and by virtual work the unknown forces of the constraints leave the model: Nᵀ Y(q, dq, ddq) θ is
what the torques of the independent joints have to be.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated, Literal

import numpy as np

from pivident.foundation.text.display import Displayed
from pivident.foundation.text.plain_values import Name, Sized
from pivident.robot.frames import Pose

#: What a closure makes equal: the origins of two frames; and their z axes; and all of them.
ClosureKind = Literal["point", "axis", "full"]

#: Directions that are perpendicular where frames meet: axis of the first, axis of the second.
DIRECTIONS: dict[ClosureKind, tuple[tuple[int, int], ...]] = {
    "point": (),
    "axis": ((2, 0), (2, 1)),
    "full": ((2, 0), (2, 1), (0, 1)),
}


@dataclass(frozen=True, eq=False)
class Closure(Displayed):
    """A frame of one link and a frame of another that meet.

    Attributes:
        name: unique name.
        links: indices of the two links in the tree, -1 for the base.
        frames: the frame in each of them.
        kind: ``point``: the origins meet, a ball joint; ``axis``: the z axes too, a hinge;
            ``full``: the frames are the same.
    """

    name: Name
    links: tuple[int, int]
    frames: tuple[Pose, Pose]
    kind: ClosureKind = "point"

    @property
    def equations(self) -> int:
        """How many equations it makes."""
        return 3 + len(DIRECTIONS[self.kind])


@dataclass(frozen=True, eq=False)
class LinearConstraint(Displayed):
    """Joints that move in proportion: Σ ratio_i q_i = offset (gears, belts, a ball screw).

    Attributes:
        name: unique name.
        ratios: of all joints of the tree, shape (tree joints,).
        offset: their sum [rad or m].
    """

    name: Name
    ratios: Annotated[np.ndarray, Sized(None)]
    offset: float = 0.0


@dataclass(frozen=True, eq=False)
class Constraints(Displayed):
    """How the joints of a robot, which are independent, move those that are not.

    Attributes:
        places: index of each joint of the robot in the tree of all joints.
        closures: frames that meet.
        linear: joints that move in proportion.
        posture: positions of all joints of the tree in which the loops are closed, shape
            (tree joints,): from there the assembly of any other posture is followed.
        driven: further joints of the tree that have motors, whose torques are measured.
        kept: equations that do not follow from the others, ascending; all are counted, closures
            first.
    """

    places: tuple[int, ...]
    closures: tuple[Closure, ...] = ()
    linear: tuple[LinearConstraint, ...] = ()
    posture: np.ndarray = field(default_factory=lambda: np.zeros(0))
    kept: tuple[int, ...] = ()
    driven: tuple[int, ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        """Name of each equation's closure or proportion."""
        closed = [c.name for c in self.closures for _ in range(c.equations)]
        return (*closed, *(one.name for one in self.linear))

    @property
    def redundant(self) -> tuple[str, ...]:
        """How many equations of which closure follow from the others, one text each."""
        names = self.names
        left = [names[k] for k in range(len(names)) if k not in self.kept]
        return tuple(f"{left.count(name)} of {name!r}" for name in dict.fromkeys(left))
