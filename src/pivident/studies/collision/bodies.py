"""The room that a robot takes: a capsule for each body, and the poses of all links.

Poses of all links in the base frame, for many postures at once.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, Literal

import numpy as np

from pivident.foundation.errors import RobotDescriptionError
from pivident.foundation.text.display import Displayed
from pivident.foundation.text.plain_values import Limits, Name
from pivident.robot.description import MAX_JOINTS, Robot
from pivident.robot.frames import Vector3

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

    name: Name
    link: Annotated[int, Limits(ge=-1, lt=MAX_JOINTS)]
    start: Vector3
    end: Vector3
    radius: Annotated[float, Limits(ge=0.0)]

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
class Outline(Displayed):
    """The bodies of a robot, and where they come from.

    Attributes:
        bodies: capsules, those of the base first, links in order.
        source: ``urdf``, ``gallery`` or ``skeleton``; ``given`` where the caller gave all of them.
        remarks: what a user should know of them, complete sentences.
        given: links whose bodies are not those of their shapes: the caller gave them, or a mesh is
            missing.
        missing: a missing mesh of each link that has one.
    """

    bodies: tuple[Body, ...]
    source: Literal["urdf", "gallery", "skeleton", "given"]
    remarks: tuple[str, ...] = ()
    given: tuple[int, ...] = ()
    missing: Mapping[int, str] = field(default_factory=dict)


def numbered(name: str, count: int) -> list[str]:
    """Names of so many bodies of one link: its own, numbered where there are several."""
    return [name] if count == 1 else [f"{name} ({k + 1})" for k in range(count)]


@dataclass(frozen=True, eq=False)
class LinkPoses:
    """Where the links are in each posture; index -1 of the links is the fixed base.

    Attributes:
        rotation: orientation of each link in the base frame, shape (links + 1, samples, 3, 3).
        origin: origin of each link in the base frame [m], shape (links + 1, samples, 3).
    """

    rotation: np.ndarray
    origin: np.ndarray

    @classmethod
    def of(cls, robot: Robot, q: np.ndarray) -> LinkPoses:
        """Forward kinematics, ⁰T_i = ⁰T_p · ^pT_i(q).

        Args:
            robot: the robot.
            q: joint positions [rad or m], shape (samples, joints).
        """
        samples = len(q)
        # the base comes last, so that the parent -1 of a joint finds it
        rotation = np.empty((robot.size + 1, samples, 3, 3))
        origin = np.empty((robot.size + 1, samples, 3))
        rotation[-1], origin[-1] = np.eye(3), 0.0
        for i, joint in enumerate(robot.joints):
            parent = rotation[joint.parent]
            mounted = parent @ joint.rotation
            origin[i] = origin[joint.parent] + parent @ joint.translation
            if joint.kind == "prismatic":
                rotation[i] = mounted
                origin[i] += mounted[..., 2] * q[:, i, None]
            else:
                c, s = np.cos(q[:, i, None]), np.sin(q[:, i, None])
                rotation[i, ..., 0] = mounted[..., 0] * c + mounted[..., 1] * s
                rotation[i, ..., 1] = mounted[..., 1] * c - mounted[..., 0] * s
                rotation[i, ..., 2] = mounted[..., 2]
        return cls(rotation, origin)

    def points(self, link: int, point: np.ndarray) -> np.ndarray:
        """A point of a link in the base frame [m], shape (samples, 3).

        Args:
            link: index of the link, -1 for the base.
            point: in the link's frame [m], shape (3,).
        """
        return self.origin[link] + self.rotation[link] @ point
