"""What the values of a stored robot must look like.

Infinite limits are written as ``"inf"`` and ``"-inf"``, since JSON has no such numbers. Reading is
strict: unknown keys, wrong types and NaN are refused.

This module needs pydantic and is imported only when a file is read or written.
"""

from __future__ import annotations

import math
from typing import Annotated, Any, Literal, TypeVar

from pydantic import BaseModel, ConfigDict, Field, PlainSerializer, ValidationError
from pydantic.functional_validators import AfterValidator, BeforeValidator

from pivident.foundation.errors import Advised, RobotDescriptionError, UnusableValue
from pivident.robot.constraints import ClosureKind
from pivident.robot.description import MAX_JOINTS, JointMotion, TorqueSide
from pivident.robot.friction_column import ShapeUnit, Smoothing
from pivident.robot.friction_terms import friction_columns
from pivident.robot.naming import nearest
from pivident.robot.wrench_sensor import Acts

#: Maximum number of characters of a name.
MAX_NAME = 1000

Root = TypeVar("Root", bound=BaseModel)


def _number_or_infinity(value: Any) -> Any:
    return {"inf": math.inf, "-inf": -math.inf}.get(value, value) if type(value) is str else value


def _text_of_infinity(value: float) -> float | str:
    return value if math.isfinite(value) else str(value)


def _not_nan(value: float) -> float:
    if math.isnan(value):
        raise ValueError("must be a number or infinite, not NaN")
    return value


def _known_function(value: str) -> str:
    known = list(friction_columns())
    if value not in known:
        raise UnusableValue("there is no such friction", advice=nearest(value, known))
    return value


Finite = Annotated[float, Field(allow_inf_nan=False)]
Bound = Annotated[
    float,
    BeforeValidator(_number_or_infinity),
    AfterValidator(_not_nan),
    PlainSerializer(_text_of_infinity),
]
Name = Annotated[str, Field(max_length=MAX_NAME)]
Vector3 = Annotated[list[Finite], Field(min_length=3, max_length=3)]
Matrix3 = Annotated[list[Vector3], Field(min_length=3, max_length=3)]
Inertia = Annotated[list[Finite], Field(min_length=10, max_length=10)]
Function = Annotated[str, AfterValidator(_known_function)]


class Values(BaseModel):
    """A table of a file: unknown keys and wrong types are refused."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)


class ShapeValues(Values):
    """A constant of a friction law."""

    name: Name
    value: Finite
    unit: ShapeUnit
    low: Bound
    high: Bound
    free: bool


class TermValues(Values):
    """One term of a friction law."""

    stem: Annotated[Name, Field(min_length=1)]
    function: Function
    smoothing: Smoothing
    gamma: Finite | None
    shapes: list[ShapeValues]


class JointValues(Values):
    """A joint."""

    name: Annotated[Name, Field(min_length=1)]
    kind: Literal["revolute", "prismatic"]
    parent: int
    rotation: Matrix3
    translation: Vector3
    position_limits: Annotated[list[Bound], Field(min_length=2, max_length=2)] | None
    rated_speed: Bound | None
    torque_limit: Bound | None
    friction: list[TermValues]
    motion: JointMotion = "driven"


class LinkValues(Values):
    """A link: its nominal ``xx xy xz yy yz zz mx my mz m``."""

    name: Name
    inertia: Inertia
    is_body: bool = True


class PoseValues(Values):
    """A frame in another."""

    rotation: Matrix3
    translation: Vector3


class ClosureValues(Values):
    """Two frames that meet; links count in the tree from zero, -1 is the base."""

    name: Name
    links: Annotated[list[int], Field(min_length=2, max_length=2)]
    frames: Annotated[list[PoseValues], Field(min_length=2, max_length=2)]
    kind: ClosureKind


class LinearValues(Values):
    """Joints of the tree that move in proportion."""

    name: Name
    ratios: Annotated[list[Finite], Field(max_length=MAX_JOINTS)]
    offset: Finite


class ConstraintValues(Values):
    """What closes the loops of a mechanism, and its passive joints and links."""

    joints: Annotated[list[JointValues], Field(max_length=MAX_JOINTS)]
    links: Annotated[list[LinkValues], Field(max_length=MAX_JOINTS)]
    places: Annotated[list[int], Field(max_length=MAX_JOINTS)]
    closures: Annotated[list[ClosureValues], Field(max_length=MAX_JOINTS)]
    linear: Annotated[list[LinearValues], Field(max_length=MAX_JOINTS)]
    posture: Annotated[list[Finite], Field(max_length=MAX_JOINTS)]
    kept: Annotated[list[int], Field(max_length=6 * MAX_JOINTS)]
    driven: Annotated[list[int], Field(max_length=MAX_JOINTS)] = []


class SensorValues(Values):
    """A force sensor."""

    name: Name
    link: Name
    frame: PoseValues
    acts: Acts


class ContactValues(Values):
    """A foot that stands."""

    link: Name
    point: Vector3


class CouplingValues(Values):
    """A coupled motor; joints count from zero."""

    motor: int
    joint: int
    ratio: Finite
    inertia: bool
    viscous: bool
    coulomb: bool


class TransmissionValues(Values):
    """Between motor and joint side."""

    reduction: list[list[Finite]]
    drive_gain: list[Finite]
    position_offset: list[Finite]
    gain_given: list[bool]


class UrdfValues(Values):
    """The URDF that the robot was read from."""

    path: str
    sha256: Annotated[str, Field(pattern="^[0-9a-f]{64}$")]
    frozen: dict[Name, Finite]


class RobotValues(Values):
    """The whole robot."""

    name: Name
    description: str
    gravity: Vector3
    joints: Annotated[list[JointValues], Field(min_length=1, max_length=MAX_JOINTS)]
    links: Annotated[list[LinkValues], Field(max_length=MAX_JOINTS)]
    rotor_inertia: Annotated[list[Finite], Field(max_length=MAX_JOINTS)]
    friction_nominal: dict[Name, Finite]
    couplings: list[CouplingValues]
    transmission: TransmissionValues
    urdf: UrdfValues | None
    torque_side: TorqueSide = "motor"
    constraints: ConstraintValues | None = None
    sensors: Annotated[list[SensorValues], Field(max_length=MAX_JOINTS)] = []
    contacts: Annotated[list[ContactValues], Field(max_length=MAX_JOINTS)] = []


def checked(model: type[Root], content: Any) -> Root:
    """Plain values as a checked object; an error names the first wrong key and its value."""
    try:
        return model.model_validate(content)
    except ValidationError as error:
        raise RobotDescriptionError.of_part("", first_problem(error)) from None


def first_problem(error: Exception) -> Exception:
    """The first problem that pydantic found: location, value, what was expected, what to do.

    Other errors say themselves what is wrong.
    """
    if not isinstance(error, ValidationError):
        return error
    problems = error.errors(include_url=False)
    first = problems[0]
    where = ".".join(str(part) for part in first["loc"]) or "the content"
    value = repr(first["input"])
    shown = f" = {value}" if len(value) <= 60 and first["type"] != "missing" else ""
    said = first.get("ctx", {}).get("error")
    if not isinstance(said, Advised):
        message = first["msg"].removeprefix("Value error, ").replace("Input should be", "must be")
        said = UnusableValue(f"{message[:1].lower()}{message[1:]}")
    fact = f"{where}{shown}: {said.fact}"
    more = f" (and {len(problems) - 1} more)" if len(problems) > 1 else ""
    return UnusableValue(fact, advice=said.advice).followed_by(more)
