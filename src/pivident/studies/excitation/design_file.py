"""A design as strict JSON with checked keys, from which it is restored exactly.

    {"format": "pivident-design", "schema": 1, "version": …, "robot": {…}, "motion": {…},
     "criterion": …, "cost": […], …, "predicted": [{…} …], "correlation": [[…] …], …}

JSON has no numbers that are not finite; they are written as null, which means in its place

- no lower or upper limit (−∞, ∞),
- a parameter that is not determined: an infinite standard error, cost or condition number,
- an unknown value or correlation (NaN).

The file is read as data of a stranger: types, shapes, names of joints, and a motion that is one.

The layout of a design's file: which keys, types and sizes are accepted.
"""

from __future__ import annotations

import math
from os import PathLike
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, ValidationError

from pivident.foundation.errors import IdentificationFileError, PividentError, UnusableValue
from pivident.foundation.files import json_object
from pivident.foundation.text.plain_values import json_of_entries, plain
from pivident.foundation.version import __version__
from pivident.robot.description import MAX_JOINTS, Robot
from pivident.robot.robot_schema import (
    Finite,
    Matrix3,
    Name,
    RobotValues,
    Values,
    Vector3,
    first_problem,
)
from pivident.robot.robot_values import made_robot, robot_values
from pivident.studies.collision.bodies import Body
from pivident.studies.collision.obstacles import Obstacle
from pivident.studies.excitation.design import (
    PAGE_RATE,
    ClearanceUse,
    Design,
    LimitUse,
    PredictedError,
)
from pivident.studies.excitation.motions import ExcitingMotion, MotionKind

#: Larger files are not designs [bytes].
MAX_FILE = 2**26
FORMAT, SCHEMA = "pivident-design", 1
#: Longest round of a motion [s], most rounds, and the largest number of functions.
MAX_DURATION, MAX_ROUNDS, MAX_FUNCTIONS = 86_400.0, 10_000, 10_000
#: A number that is written as null where it is not finite.
Known = Finite | None
Length = Annotated[float, Field(ge=0.0, allow_inf_nan=False)]


class DesignFileError(IdentificationFileError):
    """A design on disk that cannot be used.

    Attributes:
        file: the file.
        reason: what is wrong with it.
    """


def design_json(design: Design) -> str:
    """The design as strict JSON, one line for each parameter, limit and row of a matrix.

    Args:
        design: the design.
    """
    return json_of_entries(design_values(design))


def design_values(design: Design) -> dict[str, Any]:
    """The design as plain values; numbers that are not finite are None.

    Args:
        design: the design.
    """
    content = {
        "format": FORMAT,
        "schema": SCHEMA,
        "version": __version__,
        "robot": robot_values(design.robot),
        "motion": design.motion.plain(),
    }
    own = (
        *("criterion", "cost", "cost_words", "condition", "predicted", "correlation", "limits"),
        *("clearances", "noise", "notes", "settings", "bodies", "obstacles"),
        *("seconds", "torque", "torque_margin"),
    )
    return content | {name: plain(getattr(design, name)) for name in own}


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


def load_design(path: str | PathLike[str]) -> Design:
    """The design that `write_design` has written, exactly.

    Args:
        path: ``design.json``, or the folder that holds it.

    Returns:
        The design; its settings are plain values.

    Raises:
        DesignFileError: the file cannot be read, has another layout or is damaged.
    """
    file = Path(path)
    if file.is_dir():
        file = file / "design.json"
    content = _json_of(file)
    if content.get("format") != FORMAT:
        raise DesignFileError(
            str(file),
            f"is no design: its format is {content.get('format')!r}, not {FORMAT!r}",
            advice="give design.json of a folder that `pivident excite` wrote",
        )
    schema = content.get("schema")
    if type(schema) is not int or schema != SCHEMA:
        newer = type(schema) is int and schema > SCHEMA
        advice = "install a newer pivident" if newer else "design it again with `pivident excite`"
        raise DesignFileError(
            str(file), f"has layout {schema!r}, this version reads {SCHEMA}", advice=advice
        )
    try:
        return _design(DesignValues.model_validate(content))
    except (ValidationError, PividentError, ValueError) as error:
        raise DesignFileError.of_content(
            str(file),
            first_problem(error),
            "the file is damaged or was changed by hand, design it again with `pivident excite`",
        ) from None


def _json_of(file: Path) -> dict[str, Any]:
    """A JSON object as plain values."""
    try:
        return json_object(file, MAX_FILE)
    except OSError as error:
        raise DesignFileError(
            str(file),
            f"cannot be read ({error.strerror})",
            advice="check the path and its permissions",
        ) from error
    except ValueError as error:
        raise DesignFileError(
            str(file),
            str(error),
            advice="give a design.json, or design the motion again with `pivident excite`",
        ) from None


def _design(values: DesignValues) -> Design:
    """The design of checked values; refuses parts that do not belong together."""
    robot = made_robot(values.robot)
    motion = _motion(values.motion, robot)
    count = len(values.predicted)
    samples = math.floor(motion.duration * PAGE_RATE + 1e-9) + 1
    for use in values.limits:
        if use.joint not in robot.joint_names:
            raise ValueError(f"limits name the joint {use.joint!r}, which the robot does not have")
    for body in values.bodies:
        if body.link >= robot.size:
            raise ValueError(f"the body {body.name!r} is on link {body.link} of {robot.size}")
    return Design(
        robot=robot,
        motion=motion,
        criterion=values.criterion,
        cost=_pair(values.cost),
        cost_words=values.cost_words,
        condition=_pair(values.condition),
        predicted=tuple(_error(own) for own in values.predicted),
        correlation=_matrix("correlation", values.correlation, (count, count)),
        limits=tuple(_limit(own) for own in values.limits),
        clearances=tuple(ClearanceUse(**vars(own)) for own in values.clearances),
        noise=values.noise,
        notes=tuple(values.notes),
        settings=values.settings,
        bodies=tuple(_body(own) for own in values.bodies),
        obstacles=tuple(_obstacle(own) for own in values.obstacles),
        seconds=values.seconds,
        torque=_torque("torque", values.torque, (samples, robot.size)),
        torque_margin=_torque("torque_margin", values.torque_margin, (samples, robot.size)),
    )


def _motion(values: MotionValues, robot: Robot) -> ExcitingMotion:
    """The motion, once its family exists and its rows fit the robot."""
    for k, row in enumerate(values.coefficients):
        if len(row) != robot.size:
            raise ValueError(
                f"motion.coefficients: row {k} has {len(row)} numbers, the robot {robot.size} "
                "joints"
            )
    motion = ExcitingMotion.of(vars(values))
    if motion.kind == "postures" and not motion.family.move_duration > 0.0:
        raise ValueError(
            f"motion.duration: {motion.duration:g} s leave no time for {motion.family.size} moves"
        )
    return motion


def _obstacle(values: ObstacleValues) -> Obstacle:
    size = None if values.size is None else np.array(values.size)
    arrays = {"rotation": np.array(values.rotation), "translation": np.array(values.translation)}
    return Obstacle(**vars(values) | arrays | {"size": size})


def _pair(values: list[float | None]) -> tuple[float, float]:
    start, end = (math.inf if x is None else float(x) for x in values)
    return start, end


def _error(values: ErrorValues) -> PredictedError:
    content = vars(values)
    infinite = {k: math.inf for k in ("std", "before", "alone") if content[k] is None}
    unknown = {k: math.nan for k in ("value", "size") if content[k] is None}
    return PredictedError(**content | infinite | unknown)


def _limit(values: LimitValues) -> LimitUse:
    content = vars(values)
    low = -math.inf if values.low is None else values.low
    high = math.inf if values.high is None else values.high
    if not low < high or (values.quantity != "position" and not low <= 0.0 < high):
        raise ValueError(
            f"limits: {values.quantity} of {values.joint!r} has the limits {low:g} and {high:g}, "
            "between which no motion fits"
        )
    t = math.nan if values.t is None else values.t
    return LimitUse(**content | {"low": low, "high": high, "t": t})


def _body(values: BodyValues) -> Body:
    return Body(
        values.name, values.link, np.array(values.start), np.array(values.end), values.radius
    )


def _matrix(name: str, rows: list[Any], shape: tuple[int, int]) -> np.ndarray:
    """Rows as an array, None as NaN."""
    if len(rows) != shape[0] or any(len(row) != shape[1] for row in rows):
        lengths = sorted({len(row) for row in rows})
        raise UnusableValue(
            f"{name}: {len(rows)} rows of {' or '.join(map(str, lengths)) or 'no'} numbers",
            advice=f"{shape[0]} rows of {shape[1]} are needed",
        )
    return np.array(rows, dtype=float).reshape(shape)


def _torque(name: str, rows: list[Any] | None, shape: tuple[int, int]) -> np.ndarray | None:
    return None if rows is None else _matrix(name, rows, shape)
