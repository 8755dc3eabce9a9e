"""Keys of the table ``[excite]``: what a designed motion must keep to, its room, and its aim.

All in SI units on the joint side: rad and m, rad/s and m/s, N m and N. This module needs pydantic
and is imported only when a file is read.

Shapes of the solids around a robot.
"""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import (
    BeforeValidator,
    Field,
    NonNegativeFloat,
    PositiveFloat,
    PositiveFloat as Positive,
    model_validator,
)

from pivident.foundation.errors import UnusableValue
from pivident.robot.mdh_keys import Entry, JointReference, Vector3, Vector6, key
from pivident.robot.naming import nearest

#: Shapes of the solids around a robot.
ObstacleShape = Literal["box", "sphere", "cylinder", "capsule"]

SHAPES: tuple[ObstacleShape, ...] = ("box", "sphere", "cylinder", "capsule")

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
        raise UnusableValue("there is no such shape", advice=nearest(value, SHAPES))
    return value


Name = Annotated[str, Field(min_length=1, max_length=60)]
Edges = Annotated[list[Positive], Field(min_length=3, max_length=3)]


class BodyEntry(Entry):
    """A capsule of the robot in the frame of one link; it replaces those found for that link."""

    name: Name = key(meaning="what messages call it")
    link: JointReference = key(
        meaning='link that it belongs to, or the joint that moves it; `"base"`',
        kind="name or number",
    )
    start: Vector3 = key(
        meaning="one end of its segment, in the frame of the link",
        alias="from",
        unit="m",
        kind="3 numbers",
    )
    end: Vector3 = key(meaning="the other end", alias="to", unit="m", kind="3 numbers")
    radius: Positive = key(meaning="its radius", unit="m")


class ObstacleEntry(Entry):
    """A solid around the robot, in the base frame."""

    name: Name = key(meaning="what messages call it")
    shape: Annotated[ObstacleShape, BeforeValidator(_known_shape)] = key(
        meaning='`"box"` (`size`, `at`), `"sphere"` (`radius`, `at`), `"cylinder"` (`radius`, '
        '`length`, `at`), `"capsule"` (`radius`, `from`, `to`)',
    )
    at: Vector3 = key(
        [0.0, 0.0, 0.0],
        "its centre in the base frame; needed by all shapes but capsules",
        unit="m",
        kind="3 numbers",
    )
    rpy_degrees: Vector3 = key(
        [0.0, 0.0, 0.0], "roll, pitch and yaw of a box or cylinder", unit="deg", kind="3 numbers"
    )
    size: Edges | None = key(None, "edges", unit="m", kind="3 numbers", shown="needed by `box`")
    radius: Positive | None = key(None, "radius", unit="m", shown="needed by the other shapes")
    length: Positive | None = key(
        None, "length along its z axis", unit="m", shown="needed by `cylinder`"
    )
    start: Vector3 | None = key(
        None,
        "one end of its segment in the base frame",
        alias="from",
        unit="m",
        kind="3 numbers",
        shown="needed by `capsule`",
    )
    end: Vector3 | None = key(
        None, "the other end", alias="to", unit="m", kind="3 numbers", shown="needed by `capsule`"
    )

    @model_validator(mode="after")
    def _keys_belong_to_shape(self) -> ObstacleEntry:
        needed, possible = SHAPE_KEYS[self.shape]
        written = {"start": "from", "end": "to"}
        given = {written.get(key, key) for key in self.model_fields_set} - {"name", "shape"}
        foreign = sorted(given - needed - possible)
        if foreign:
            own = ", ".join(sorted(needed | possible))
            raise UnusableValue(
                f"a {self.shape} has no {', '.join(foreign)}", advice=f"it has {own}"
            )
        missing = sorted(needed - given)
        if missing:
            wanted = " and ".join(_MEANING[key] for key in missing)
            raise ValueError(f"a {self.shape} needs {wanted} ({', '.join(missing)})")
        return self


class ToolBoxEntry(Entry):
    """Corners of the box that the tool stays in, in the base frame."""

    low: Vector3 = key(meaning="lowest corner", unit="m", kind="3 numbers")
    high: Vector3 = key(meaning="highest corner", unit="m", kind="3 numbers")

    @model_validator(mode="after")
    def _holds_something(self) -> ToolBoxEntry:
        if not all(low < high for low, high in zip(self.low, self.high, strict=True)):
            raise UnusableValue("is empty", advice="each number of low must be below that of high")
        return self


class RoomEntry(Entry):
    """Bodies of the robot and what is around it."""

    body: Annotated[list[BodyEntry], Field(max_length=MAX_BODIES)] = key(
        factory=list,
        meaning="`[[excite.body]]`: capsules of the robot, see *body*; those of a link replace "
        "what "
        "the URDF has for it",
    )
    obstacle: Annotated[list[ObstacleEntry], Field(max_length=MAX_BODIES)] = key(
        factory=list, meaning="`[[excite.obstacle]]`: solids around the robot, see *obstacle*"
    )
    floor: float | None = key(
        None, "height of a floor in the base frame, above which all moving bodies stay", unit="m"
    )
    tool: Vector3 | None = key(
        None,
        "point in the frame of the last link that stays in `tool_box`",
        unit="m",
        kind="3 numbers",
    )
    tool_box: ToolBoxEntry | None = key(
        None, "box in the base frame that the tool stays in, see *tool_box*", unit="m"
    )
    clearance: NonNegativeFloat = key(
        CLEARANCE, "what bodies keep from each other, from obstacles and from the floor", unit="m"
    )

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

    position: Annotated[list[float], Field(min_length=2, max_length=2)] | None = key(
        None, "lowest and highest position", unit="rad or m", kind="2 numbers", shown="the model's"
    )
    speed: PositiveFloat | None = key(
        None, "largest speed", unit="rad/s or m/s", shown="the model's"
    )
    acceleration: PositiveFloat | None = key(
        None, "largest acceleration", unit="rad/s² or m/s²", shown="that of `[excite]`"
    )
    jerk: PositiveFloat | None = key(
        None, "largest jerk", unit="rad/s³ or m/s³", shown="that of `[excite]`"
    )
    torque: PositiveFloat | None = key(None, "largest torque", unit="N m or N", shown="the model's")
    rms_torque: PositiveFloat | None = key(
        None, "largest root mean square of the torque, which heats the motor", unit="N m or N"
    )


class LoadBodyEntry(Entry):
    """A body at the last link, which a payload or drive gains are identified with."""

    mass: PositiveFloat = key(meaning="its mass, expected or known", unit="kg")
    center_of_mass: Vector3 = key(
        [0.0, 0.0, 0.05], "in the frame of the last link", unit="m", kind="3 numbers"
    )
    inertia: Vector6 | None = key(
        None,
        "xx, xy, xz, yy, yz, zz about the centre of mass; none: a point",
        unit="kg m²",
        kind="6 numbers",
    )


class ExciteEntry(RoomEntry):
    """What a designed motion must keep to, and what is asked of it."""

    duration: PositiveFloat | None = key(
        None, "of the motion, 2 to 300; with `to` the longest that is tried", unit="s", shown="`20`"
    )
    motion: Literal["fourier", "splines", "postures"] | None = key(
        None,
        '`"fourier"`, `"splines"`, or `"postures"`: moves from posture to posture, for teach '
        "pendants",
        shown='`"splines"`',
    )
    criterion: Literal["d", "a", "worst", "cond"] | None = key(
        None,
        'what is made small: `"a"` (mean squared relative standard error), `"d"` '
        '(determinant), `"worst"` (largest relative standard error), `"cond"` (condition '
        "number)",
        shown='`"a"`, with `parameters` `"worst"`',
    )
    parameters: list[str] = key(meaning="base parameters that count; none: all", factory=list)
    to: Annotated[float, Field(gt=0.0, lt=1.0)] | None = key(
        None,
        "relative standard error that each of `parameters` must reach, 0 to 1; the shortest "
        "motion that gives it is designed",
    )
    start: list[float] | None = key(
        None,
        "posture at both ends, one number for each joint",
        unit="rad or m",
        kind="list of numbers",
        shown="chosen",
    )
    seconds: PositiveFloat | None = key(None, "time for the search", unit="s", shown="`20`")
    seed: Annotated[int, Field(ge=0)] | None = key(None, "of the random starts", shown="`0`")
    rate: PositiveFloat | None = key(
        None, "of the samples in `motion.csv` and `motion.npz`", unit="Hz", shown="`1000`"
    )
    speed: Share = key(1.0, "share of the described speed limits that is used, above 0 to 1")
    torque: Share = key(1.0, "share of the described torque limits that is used, above 0 to 1")
    acceleration: PositiveFloat | list[PositiveFloat] | None = key(
        None,
        "largest accelerations",
        unit="rad/s² or m/s²",
        kind="number(s)",
        shown="largest speed in 0.25 s",
    )
    jerk: PositiveFloat | list[PositiveFloat] | None = key(
        None, "largest jerks", unit="rad/s³ or m/s³", kind="number(s)"
    )
    torque_noise: PositiveFloat | list[PositiveFloat] | None = key(
        None,
        "standard deviation of the torque in 40 independent rows per second, where no "
        "earlier result gives the noise",
        unit="N m or N",
        kind="number(s)",
        shown="1 % of the largest torques",
    )
    joint: dict[str, JointLimitEntry] = key(
        meaning="by name of the joint, see *joint limits*: `[excite.joint.elbow]`",
        factory=dict,
        kind="table of tables",
    )
    about: Literal["robot", "load", "gains"] = key(
        "robot",
        '`"robot"`; `"load"` or `"gains"`: the motion is run without and with the body of '
        "`load`, for `pivident payload` and `pivident gains`",
    )
    load: LoadBodyEntry | None = key(None, "that body, see *load*")

    @model_validator(mode="after")
    def _load_belongs_to_its_question(self) -> ExciteEntry:
        if self.about != "robot" and self.load is None:
            raise ValueError(
                f"about = {self.about!r} needs the body that the second run is taken with: add "
                "[excite.load] with mass = … (kg) and center_of_mass = [x, y, z] (m, in the frame "
                "of the last link)"
            )
        return self
