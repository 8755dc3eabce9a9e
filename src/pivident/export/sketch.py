"""A robot as sticks for display: along each link, and along its joint's axis."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pivident.export.xml_text import rpy
from pivident.models.possible_values import link_inertias
from pivident.models.runnable_model import RunnableModel
from pivident.robot.frames import rotation_from_z_to

#: Radius of a stick over the sum of all link lengths; axes are twice as thick.
SLENDERNESS = 0.02

#: Reach that is assumed where all joints are in one point [m].
MIN_REACH = 0.1


@dataclass(frozen=True, eq=False)
class Stick:
    """A straight stick in the frame of its link."""

    start: np.ndarray  # [m], shape (3,)
    end: np.ndarray  # [m], shape (3,)
    radius: float  # [m]

    def cylinder(self) -> tuple[np.ndarray, np.ndarray, float]:
        """Centre [m], roll pitch yaw [rad] and length [m] of a cylinder from end to end."""
        along = self.end - self.start
        length = float(np.linalg.norm(along))
        return 0.5 * (self.start + self.end), rpy(rotation_from_z_to(along / length)), length


def sticks(model: RunnableModel) -> dict[int, tuple[Stick, ...]]:
    """Sticks of every link by its index, -1 for the base.

    A link reaches to the joints that it carries and to where it closes loops; the last ones to
    their centre of mass.
    """
    robot, constraints = model.robot.tree, model.robot.constraints
    reach = sum(float(np.linalg.norm(joint.translation)) for joint in robot.joints)
    radius = SLENDERNESS * max(reach, MIN_REACH)
    inertia = link_inertias(model)
    found: dict[int, tuple[Stick, ...]] = {}
    for i in range(-1, robot.size):
        ends = [joint.translation for joint in robot.joints if joint.parent == i]
        for closure in constraints.closures if constraints else ():
            pairs = zip(closure.links, closure.frames, strict=True)
            ends += [frame.translation for link, frame in pairs if link == i]
        if i >= 0 and not ends and inertia[i, 9] > 0.0:
            ends = [inertia[i, 6:9] / inertia[i, 9]]
        own = [Stick(np.zeros(3), end, radius) for end in ends if np.linalg.norm(end) > radius]
        if i >= 0:
            axis = np.array([0.0, 0.0, 2.0 * radius])
            own.insert(0, Stick(-axis, axis, 2.0 * radius))
        found[i] = tuple(own)
    return found
