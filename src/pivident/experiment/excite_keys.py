"""Keys of the table ``[excite]``: what a designed motion must keep to, its room, and its aim.

All in SI units on the joint side: rad and m, rad/s and m/s, N m and N. This module needs pydantic
and is imported only when a file is read.
"""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BeforeValidator, Field, NonNegativeFloat, PositiveFloat, model_validator
from pydantic import PositiveFloat as Positive

from pivident.experiment.room_shapes import SHAPES, ObstacleShape
from pivident.robot.mdh_schema import Entry, JointReference, Vector3, Vector6
from pivident.robot.naming import nearest

#: Clearance that is kept where none is asked for [m].
CLEARANCE = 0.02

#: Most bodies or obstacles of a file.
MAX_BODIES = 100

#: Keys of each shape besides its name: those it needs, and those it may have.
SHAPE_KEYS: dict[str, tuple[set[str], set[str]]] = {
    "box": ({"size", "at"}, {"rpy_degrees"}),
    "sphere": ({"radius", "at"}, set()),
    "cylinder": ({"radius", "length", "at"}, {"rpy_degrees"}),
    "capsule": ({"radius", "from", "to"}, set()),
}

#: Description of a required key that is missing.
_MEANING = {
    "at": "its centre in the base frame",
    "from": "one end of its segment in the base frame",
    "length": "its length along its z axis",
    "radius": "its radius",
    "size": "its three edges",
    "to": "the other end of its segment",
}


def _known_shape(value: object) -> object:
    if isinstance(value, str) and value not in SHAPES:
        raise ValueError(f"there is no such shape; {nearest(value, SHAPES)}")
    return value


Name = Annotated[str, Field(min_length=1, max_length=60)]
Edges = Annotated[list[Positive], Field(min_length=3, max_length=3)]


class BodyEntry(Entry):
    """A capsule of the robot in the frame of one link; it replaces those found for that link."""

    name: Name
    link: JointReference
    start: Vector3 = Field(alias="from")
    end: Vector3 = Field(alias="to")
    radius: Positive


class ObstacleEntry(Entry):
    """A solid around the robot, in the base frame."""

    name: Name
    shape: Annotated[ObstacleShape, BeforeValidator(_known_shape)]
    at: Vector3 = Field([0.0, 0.0, 0.0])
    rpy_degrees: Vector3 = Field([0.0, 0.0, 0.0])
    size: Edges | None = None
    radius: Positive | None = None
    length: Positive | None = None
    start: Vector3 | None = Field(None, alias="from")
    end: Vector3 | None = Field(None, alias="to")

    @model_validator(mode="after")
    def _keys_belong_to_shape(self) -> ObstacleEntry:
        needed, possible = SHAPE_KEYS[self.shape]
        written = {"start": "from", "end": "to"}
        given = {written.get(key, key) for key in self.model_fields_set} - {"name", "shape"}
        foreign = sorted(given - needed - possible)
        if foreign:
            own = ", ".join(sorted(needed | possible))
            raise ValueError(f"a {self.shape} has no {', '.join(foreign)}; it has {own}")
        missing = sorted(needed - given)
        if missing:
            wanted = " and ".join(_MEANING[key] for key in missing)
            raise ValueError(f"a {self.shape} needs {wanted} ({', '.join(missing)})")
        return self


class ToolBoxEntry(Entry):
    """Corners of the box that the tool stays in, in the base frame."""

    low: Vector3
    high: Vector3

    @model_validator(mode="after")
    def _holds_something(self) -> ToolBoxEntry:
        if not all(low < high for low, high in zip(self.low, self.high, strict=True)):
            raise ValueError("is empty; each number of low must be below that of high")
        return self


class RoomEntry(Entry):
    """Bodies of the robot and what is around it."""

    body: Annotated[list[BodyEntry], Field(max_length=MAX_BODIES)] = Field(default_factory=list)
    obstacle: Annotated[list[ObstacleEntry], Field(max_length=MAX_BODIES)] = Field(
        default_factory=list
    )
    floor: float | None = None
    tool: Vector3 | None = None
    tool_box: ToolBoxEntry | None = None
    clearance: NonNegativeFloat = CLEARANCE

    @model_validator(mode="after")
    def _box_has_a_tool(self) -> RoomEntry:
        if self.tool_box is not None and self.tool is None:
            raise ValueError(
                "tool_box needs tool = [x, y, z], the point in the last link's frame that stays in "
                "the box"
            )
        return self


Share = Annotated[float, Field(gt=0.0, le=1.0)]


class JointLimitEntry(Entry):
    """Limits of one joint in place of those of its description."""

    position: Annotated[list[float], Field(min_length=2, max_length=2)] | None = None
    speed: PositiveFloat | None = None
    acceleration: PositiveFloat | None = None
    jerk: PositiveFloat | None = None
    torque: PositiveFloat | None = None
    rms_torque: PositiveFloat | None = None


class LoadBodyEntry(Entry):
    """A body at the last link, which a payload or drive gains are identified with."""

    mass: PositiveFloat
    center_of_mass: Vector3 = Field([0.0, 0.0, 0.05])
    inertia: Vector6 | None = None


class ExciteEntry(RoomEntry):
    """What a designed motion must keep to, and what is asked of it."""

    duration: PositiveFloat | None = None
    motion: Literal["fourier", "splines", "postures"] | None = None
    criterion: Literal["d", "a", "worst", "cond"] | None = None
    parameters: list[str] = Field(default_factory=list)
    to: Annotated[float, Field(gt=0.0, lt=1.0)] | None = None
    start: list[float] | None = None
    seconds: PositiveFloat | None = None
    seed: Annotated[int, Field(ge=0)] | None = None
    rate: PositiveFloat | None = None
    speed: Share = 1.0
    torque: Share = 1.0
    acceleration: PositiveFloat | list[PositiveFloat] | None = None
    jerk: PositiveFloat | list[PositiveFloat] | None = None
    torque_noise: PositiveFloat | list[PositiveFloat] | None = None
    joint: dict[str, JointLimitEntry] = Field(default_factory=dict)
    about: Literal["robot", "load", "gains"] = "robot"
    load: LoadBodyEntry | None = None

    @model_validator(mode="after")
    def _load_belongs_to_its_question(self) -> ExciteEntry:
        if self.about != "robot" and self.load is None:
            raise ValueError(
                f"about = {self.about!r} needs the body that the second run is taken with: add "
                "[excite.load] with mass = … (kg) and center_of_mass = [x, y, z] (m, in the frame "
                "of the last link)"
            )
        return self
