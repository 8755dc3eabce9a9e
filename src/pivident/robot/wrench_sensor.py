"""Force sensors: where they sit, and on whom the measured wrench acts."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal, get_args

import numpy as np

from pivident.foundation.errors import RobotDescriptionError
from pivident.foundation.text.plain_values import Name
from pivident.robot.frames import Pose

#: Whether a sensor measures what its surroundings do to the robot, or the robot to them.
Acts = Literal["on_robot", "by_robot"]

#: Components of a wrench in their order, forces in N and moments about the sensor's origin in N m.
COMPONENTS = ("fx", "fy", "fz", "mx", "my", "mz")


#: Link of a sensor under the base, or on a base that floats.
BASE = "base"


@dataclass(frozen=True, eq=False)
class WrenchSensor:
    """A sensor of force and moment.

    Attributes:
        name: unique name.
        link: the link that the wrench acts on, by its own name or that of its joint; ``base`` for
            a sensor under the base.
        frame: axes and origin in which the wrench is measured, in the frame of the link.
        acts: ``on_robot``: the force that the surroundings apply to the link; ``by_robot``: the
            force that the link applies to its surroundings.
    """

    name: Name
    link: Name
    frame: Pose = field(default_factory=Pose.identity)
    acts: Acts = "on_robot"

    def __post_init__(self) -> None:
        if self.acts not in get_args(Acts):
            raise RobotDescriptionError(
                f"wrench sensor {self.name!r}: acts is {self.acts!r}",
                advice=f"choose {' or '.join(map(repr, get_args(Acts)))}",
            )
        rotation, origin = self.frame.rotation, self.frame.translation
        if not np.abs(rotation @ rotation.T - np.eye(3)).max() <= 1e-9:
            raise RobotDescriptionError(
                f"wrench sensor {self.name!r}: the rotation of its frame is not orthonormal"
            )
        if np.shape(origin) != (3,) or not np.isfinite(origin).all():
            raise RobotDescriptionError(
                f"wrench sensor {self.name!r}: its origin is {origin}",
                advice="three finite numbers in m are needed",
            )

    @property
    def sign(self) -> float:
        """What turns the measured wrench into that on the robot."""
        return 1.0 if self.acts == "on_robot" else -1.0
