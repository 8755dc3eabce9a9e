"""What messages are made of: the text definitions (.msg) that bags carry, read as tables.

A definition is data here. It is parsed into names and types, and a walk over a message follows
them; no code is made of it.

    std_msgs/Header header
    string[] name
    float64[] position
    ================================================================================
    MSG: std_msgs/Header
    …
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import lru_cache

from pivident.foundation.errors import FileFormatError

#: Longest text of a definition, in characters, and most fields of all its types.
MAX_DEFINITION, MAX_FIELDS = 2**20, 10_000

#: Sizes of the numbers [bytes] and their codes in numpy; ``time`` is seconds and nanoseconds.
NUMBERS = {
    "bool": (1, "u1"), "byte": (1, "u1"), "char": (1, "u1"), "octet": (1, "u1"),
    "int8": (1, "i1"), "uint8": (1, "u1"), "int16": (2, "i2"), "uint16": (2, "u2"),
    "int32": (4, "i4"), "uint32": (4, "u4"), "int64": (8, "i8"), "uint64": (8, "u8"),
    "float32": (4, "f4"), "float64": (8, "f8"),
}  # fmt: skip

#: Types that are two words, seconds and nanoseconds.
TIMES = {"time", "duration", "builtin_interfaces/Time", "builtin_interfaces/Duration"}


@dataclass(frozen=True)
class Field:
    """One field of a message."""

    name: str
    type: str  # ``float64``, ``string``, ``time`` or the full name of another type
    count: int | None = None  # None for a single value, -1 for a sequence


#: Fields of each type by its full name, ``package/Type``.
Definitions = dict[str, tuple[Field, ...]]

_FIELD = re.compile(
    r"(?P<type>[A-Za-z]\w*(?:/\w+){0,2})(?:<=\d+)?(?P<array>\[(?:<=)?(?P<size>\d*)\])?"
    r"\s+(?P<name>[A-Za-z]\w*)(?:\s.*)?"
)
_CONSTANT = re.compile(r"\S+\s+\w+\s*=.*")

_POINT = """
float64[] positions
float64[] velocities
float64[] accelerations
float64[] effort
duration time_from_start
"""
_HEADER = "time stamp\nstring frame_id\n"
_POINTS = f"MSG: trajectory_msgs/JointTrajectoryPoint\n{_POINT}"
_MULTI = """
MSG: trajectory_msgs/MultiDOFJointTrajectoryPoint
geometry_msgs/Transform[] transforms
geometry_msgs/Twist[] velocities
geometry_msgs/Twist[] accelerations
duration time_from_start
MSG: geometry_msgs/Transform
geometry_msgs/Vector3 translation
geometry_msgs/Quaternion rotation
MSG: geometry_msgs/Twist
geometry_msgs/Vector3 linear
geometry_msgs/Vector3 angular
MSG: geometry_msgs/Vector3
float64 x
float64 y
float64 z
MSG: geometry_msgs/Quaternion
float64 x
float64 y
float64 z
float64 w
"""


def _state(*parts: str, multi: tuple[str, ...] = ()) -> str:
    """A version of the controller's state: its points by name, then those of free joints."""
    points = "".join(f"trajectory_msgs/JointTrajectoryPoint {part}\n" for part in parts)
    free = "string[] multi_dof_joint_names\n" if multi else ""
    free += "".join(f"trajectory_msgs/MultiDOFJointTrajectoryPoint {part}\n" for part in multi)
    return f"std_msgs/Header header\nstring[] joint_names\n{points}{free}{_POINTS}{_MULTI}"


_FREE = ("multi_dof_reference", "multi_dof_feedback", "multi_dof_error", "multi_dof_output")

#: Definitions of bags that carry none (ROS 2 before Iron), every version in use, newest first.
KNOWN: dict[str, tuple[str, ...]] = {
    "sensor_msgs/JointState": (
        "std_msgs/Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\n"
        "float64[] effort\n",
    ),
    "control_msgs/JointTrajectoryControllerState": (
        _state("reference", "feedback", "error", "output", multi=_FREE),
        _state("reference", "feedback", "error", "output"),
        _state("desired", "actual", "error"),
        _state("desired", "actual", "error", "reference", "feedback", "output", multi=_FREE),
    ),
    "std_msgs/Float64MultiArray": (
        "std_msgs/MultiArrayLayout layout\nfloat64[] data\nMSG: std_msgs/MultiArrayLayout\n"
        "std_msgs/MultiArrayDimension[] dim\nuint32 data_offset\n"
        "MSG: std_msgs/MultiArrayDimension\nstring label\nuint32 size\nuint32 stride\n",
    ),
}


@lru_cache(maxsize=64)
def parse_definition(type_name: str, text: str) -> Definitions:
    """Fields of a type and of the types it is made of; topics of one type are read once."""
    if len(text) > MAX_DEFINITION:
        raise FileFormatError(f"the definition of {_shown(type_name)} has {len(text)} characters")
    current = short_name(type_name)
    found: dict[str, list[Field]] = {current: []}
    for raw in text.splitlines():
        line = raw.partition("#")[0].strip()
        if not line or line.startswith("====") or (_CONSTANT.fullmatch(line) and "<=" not in line):
            continue
        if line.startswith("MSG:"):
            current = short_name(line[4:].strip())
            found.setdefault(current, [])
            continue
        field = _FIELD.fullmatch(line)
        if field is None or sum(map(len, found.values())) >= MAX_FIELDS:
            raise FileFormatError(
                f"the definition of {_shown(type_name)} has a line that is no field: {_shown(line)}"
            )
        count = None if field["array"] is None else -1
        if field["size"] and "<=" not in field["array"]:
            count = int(field["size"][:9])
        found[current].append(Field(field["name"], _resolved(field["type"], current), count))
    found.setdefault("std_msgs/Header", [Field("stamp", "time"), Field("frame_id", "string")])
    definitions = {name: tuple(fields) for name, fields in found.items()}
    _check_complete(short_name(type_name), definitions)
    return definitions


def short_name(type_name: str) -> str:
    """``package/Type`` of a type that ROS 2 calls ``package/msg/Type``."""
    return type_name.replace("/msg/", "/")


def _resolved(name: str, within: str) -> str:
    """Full name of a field's type, or ``time`` for all that is seconds and nanoseconds."""
    name = short_name(name)
    if name in TIMES:
        return "time"
    if name in NUMBERS or name in ("string", "wstring") or "/" in name:
        return name
    return "std_msgs/Header" if name == "Header" else f"{within.partition('/')[0]}/{name}"


def _check_complete(type_name: str, definitions: Definitions) -> None:
    """Refuse types that are missing or contain themselves: a walk over them would not end."""
    finished: set[str] = set()
    path: list[str] = []

    def visit(name: str) -> None:
        if name in finished:
            return
        if name in path or len(path) > 32:
            raise FileFormatError(f"the message type {_shown(name)} contains itself")
        if name not in definitions:
            raise FileFormatError(f"the message type {_shown(name)} is not defined in the bag")
        path.append(name)
        for field in definitions[name]:
            if field.type not in NUMBERS and field.type not in ("string", "wstring", "time"):
                visit(field.type)
        path.pop()
        finished.add(name)

    visit(type_name)


def _shown(text: str) -> str:
    """A text from a bag as a message repeats it."""
    return ascii(text[:80])
