"""The room that a robot has: solid obstacles, a floor, and a box that the tool stays in."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from pivident.experiment.excite_keys import SHAPES, ObstacleShape
from pivident.foundation.errors import ExperimentError
from pivident.foundation.text.display import Displayed
from pivident.foundation.text.plain_values import Limits, Name
from pivident.robot.description import Robot
from pivident.robot.frames import Matrix3, Vector3, rotation_from_z_to
from pivident.robot.naming import nearest
from pivident.studies.collision.distances import BOX, CYLINDER, SEGMENT

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
        if self.shape not in SHAPES:
            raise ExperimentError(
                f"{where}: shape {self.shape!r}", advice=nearest(self.shape, SHAPES)
            )
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
