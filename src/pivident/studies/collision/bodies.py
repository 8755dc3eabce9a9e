"""The room that a robot takes, and that it has.

A capsule for each body, and the poses of all links in the base frame, for many postures at once.
Solid obstacles, a floor, and a box that the tool stays in.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, Literal

import numpy as np

from pivident.experiment.excite_keys import SHAPES, ObstacleShape
from pivident.foundation.errors import ExperimentError, RobotDescriptionError, require_known
from pivident.foundation.text.display import Displayed
from pivident.foundation.text.plain_values import Limits, Name
from pivident.robot.description import MAX_JOINTS, Robot
from pivident.robot.frames import Matrix3, Vector3, rotation_from_z_to
from pivident.studies.collision.distances import BOX, CYLINDER, SEGMENT

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


Length = Annotated[float, Limits(ge=0.0)]


@dataclass(frozen=True, eq=False)
class Obstacle(Displayed):
    """A solid that stands still in the base frame, centred on its own frame.

    Attributes:
        name: unique name.
        shape: ``box``, ``sphere``, ``cylinder`` or ``capsule``.
        rotation: orientation of its frame in the base frame, shape (3, 3).
        translation: its centre in the base frame [m], shape (3,).
        size: edges of a box [m], shape (3,); None for the other shapes.
        radius: of a sphere, cylinder or capsule [m].
        length: of a cylinder or capsule along its z axis, without the capsule's caps [m].
    """

    name: Name
    shape: ObstacleShape
    rotation: Matrix3
    translation: Vector3
    size: Vector3 | None = None
    radius: Length = 0.0
    length: Length = 0.0

    def __post_init__(self) -> None:
        where = f"obstacle {self.name!r}"
        require_known(self.shape, SHAPES, f"{where}: shape {self.shape!r}", ExperimentError)
        rotation = np.asarray(self.rotation)
        # Comparisons are written so that NaN fails them.
        if rotation.shape != (3, 3) or not np.abs(rotation @ rotation.T - np.eye(3)).max() < 1e-6:
            raise ExperimentError(f"{where}: its rotation is no rotation matrix")
        if np.shape(self.translation) != (3,) or not np.isfinite(self.translation).all():
            raise ExperimentError(
                f"{where}: at = {self.translation} must be three finite numbers in metres"
            )
        if self.shape == "box":
            size = np.asarray(self.size, dtype=float)
            if size.shape != (3,) or not np.isfinite(size).all() or not size.min() > 0.0:
                raise ExperimentError(
                    f"{where}: size = {self.size} must be three positive edges in metres"
                )
            return
        needed = {"radius": self.radius}
        if self.shape == "cylinder":
            needed["length"] = self.length
        for key, value in needed.items():
            if not 0.0 < value < np.inf:
                raise ExperimentError(f"{where}: {key} = {value} must be positive, in metres")
        if not 0.0 <= self.length < np.inf:
            raise ExperimentError(f"{where}: length = {self.length} must not be negative")

    @classmethod
    def capsule(cls, name: str, start: np.ndarray, end: np.ndarray, radius: float) -> Obstacle:
        """All points within a radius of a segment.

        Args:
            name: unique name.
            start: one end of the segment in the base frame [m], shape (3,).
            end: its other end, likewise.
            radius: [m].

        Returns:
            The obstacle.
        """
        start, end = np.array(start, dtype=float), np.array(end, dtype=float)
        length = float(np.linalg.norm(end - start))
        rotation = rotation_from_z_to((end - start) / length) if length > 0.0 else np.eye(3)
        return cls(name, "capsule", rotation, 0.5 * (start + end), radius=radius, length=length)

    @property
    def kind(self) -> int:
        """Which solid of `collision.distances` it is; a sphere is a segment without length."""
        return {"box": BOX, "cylinder": CYLINDER}.get(self.shape, SEGMENT)

    @property
    def solid(self) -> np.ndarray:
        """The numbers that `studies.collision.distances.signed_distance` takes, shape (1, 6) [m].

        Of a segment they are its ends in the base frame.
        """
        if self.size is not None and self.shape == "box":
            return np.array([[*(0.5 * np.asarray(self.size, dtype=float)), 0.0, 0.0, 0.0]])
        if self.shape == "cylinder":
            return np.array([[self.radius, 0.5 * self.length, 0.0, 0.0, 0.0, 0.0]])
        half = 0.5 * self.length * np.asarray(self.rotation)[:, 2]
        return np.concatenate([self.translation - half, self.translation + half])[None, :]

    @property
    def skin(self) -> float:
        """What lies around the solid of `kind`: the radius of a sphere or capsule, else 0 [m]."""
        return self.radius if self.kind == SEGMENT else 0.0


@dataclass(frozen=True, eq=False)
class ToolBox(Displayed):
    """A box along the axes of the base frame that a point of the tool must not leave.

    Attributes:
        point: the point in its link's frame [m], shape (3,).
        low: lowest coordinates in the base frame [m], shape (3,); -inf for none.
        high: highest coordinates, likewise; inf for none.
        link: index of the link; None for the last one.
    """

    point: np.ndarray
    low: np.ndarray
    high: np.ndarray
    link: int | None = None

    def __post_init__(self) -> None:
        if np.shape(self.point) != (3,) or not np.isfinite(self.point).all():
            raise ExperimentError(
                f"tool = {self.point} must be three finite numbers in metres, a point in the frame "
                "of the last link"
            ).about("tool")
        if np.shape(self.low) != (3,) or np.shape(self.high) != (3,):
            raise ExperimentError(
                "tool_box: low and high are three numbers each, corners in the base frame"
            ).about("tool_box")
        if not (np.asarray(self.low) < np.asarray(self.high)).all():
            raise ExperimentError(
                f"tool_box: low = {self.low} is not below high = {self.high}",
                advice="the box is empty",
            ).about("tool_box")


def upward(robot: Robot) -> np.ndarray:
    """Unit vector against gravity in the base frame, shape (3,).

    Args:
        robot: the robot.

    Raises:
        ExperimentError: the robot has no gravity, so nothing says where up is.
    """
    size = float(np.linalg.norm(robot.gravity))
    if not size > 0.0:
        raise ExperimentError(
            f"floor: robot {robot.name!r} has no gravity, which says where up is",
            advice="give the floor as an obstacle instead, a box below the robot",
        ).about("floor")
    return -np.asarray(robot.gravity, dtype=float) / size


def floor_plate(robot: Robot, height: float, width: float) -> Obstacle:
    """A thin plate that shows where the floor is.

    Args:
        robot: the robot, whose gravity says where down is.
        height: of the floor above the base's origin [m].
        width: of the plate [m].
    """
    up, thickness = upward(robot), 0.002
    middle = (height - 0.5 * thickness) * up
    size = np.array([width, width, thickness])
    return Obstacle("floor", "box", rotation_from_z_to(up), middle, size)
