"""The layout of a design's file: which keys, types and sizes are accepted."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field

from pivident.excitation.motions import MotionKind
from pivident.robot.description import MAX_JOINTS
from pivident.robot.robot_schema import Finite, Matrix3, Name, RobotValues, Values, Vector3

FORMAT, SCHEMA = "pivident-design", 1

#: Longest round of a motion [s], most rounds, and the largest number of functions.
MAX_DURATION, MAX_ROUNDS, MAX_FUNCTIONS = 86_400.0, 10_000, 10_000

#: A number that is written as null where it is not finite.
Known = Finite | None
Length = Annotated[float, Field(ge=0.0, allow_inf_nan=False)]


class MotionValues(Values):
    """The motion."""

    kind: MotionKind
    duration: Annotated[float, Field(gt=0.0, le=MAX_DURATION)]
    rounds: Annotated[int, Field(ge=1, le=MAX_ROUNDS)] = 1
    coefficients: Annotated[list[list[Finite]], Field(min_length=1, max_length=MAX_FUNCTIONS)]


class LimitValues(Values):
    """Use of one limit."""

    joint: Name
    quantity: Literal["position", "speed", "acceleration", "jerk", "torque", "rms torque"]
    unit: Name
    low: Known
    high: Known
    least: Finite
    largest: Finite
    t: Known
    source: Name


class ClearanceValues(Values):
    """Use of the room between two bodies."""

    name: Name
    least: Finite
    needed: Finite
    t: Finite


class ErrorValues(Values):
    """Prediction for one parameter."""

    name: Name
    unit: Name
    value: Known
    std: Known
    before: Known
    wanted: bool
    remark: str
    alone: Known
    size: Known


class BodyValues(Values):
    """A capsule of the robot."""

    name: Name
    link: Annotated[int, Field(ge=-1, lt=MAX_JOINTS)]
    start: Vector3
    end: Vector3
    radius: Length


class ObstacleValues(Values):
    """An obstacle: its shape, the sizes that the shape has, and its pose in the base frame.

    Sizes are edge lengths of a box, the radius of the other shapes, and the length of a cylinder or
    of a capsule's segment [m]; both lie along the z axis of the obstacle's frame.
    """

    name: Name
    shape: Literal["box", "sphere", "cylinder", "capsule"]
    size: Annotated[list[Length], Field(min_length=3, max_length=3)] | None
    radius: Length
    length: Length
    rotation: Matrix3
    translation: Vector3


class DesignValues(Values):
    """The whole file."""

    format: Literal["pivident-design"]
    schema_: Annotated[Literal[1], Field(alias="schema")]
    version: Name
    robot: RobotValues
    motion: MotionValues
    criterion: str
    cost: Annotated[list[Known], Field(min_length=2, max_length=2)]
    cost_words: str
    condition: Annotated[list[Known], Field(min_length=2, max_length=2)]
    predicted: list[ErrorValues]
    correlation: list[list[Known]]
    limits: list[LimitValues]
    clearances: list[ClearanceValues]
    noise: str
    notes: list[str]
    settings: dict[str, Any]
    bodies: list[BodyValues]
    obstacles: list[ObstacleValues]
    seconds: Length
    torque: list[list[Finite]] | None
    torque_margin: list[list[Finite]] | None
