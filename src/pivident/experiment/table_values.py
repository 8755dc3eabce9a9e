"""Values of an experiment file: numbers for each joint, ranges, paths, and what they may be.

This module needs pydantic and is imported only when a file is read.
"""

from __future__ import annotations

import math
from pathlib import PurePath
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, Field
from pydantic.functional_validators import PlainValidator

from pivident.errors import UnusableValue
from pivident.simulation.controllers import UNKNOWN_GAIN
from pivident.text.printable import is_printable


def _is_number(value: Any) -> bool:
    if not isinstance(value, (int, float)) or isinstance(value, bool):
        return False
    try:
        return math.isfinite(value)
    except OverflowError:  # a whole number of hundreds of digits
        return False


def _numbers(value: Any) -> Any:
    if _is_number(value) or (isinstance(value, list) and value and all(map(_is_number, value))):
        return value
    raise ValueError("must be a number for all joints, or a list with one number for each joint")


def _drive_gain(value: Any) -> Any:
    return value if value == UNKNOWN_GAIN else _numbers(value)


def _positive_numbers(value: Any) -> Any:
    listed = _numbers(value) if isinstance(value, list) else [_numbers(value)]
    if min(listed) > 0:
        return tuple(map(float, listed)) if isinstance(value, list) else float(value)
    raise ValueError("must be a positive number, or a list with one for each joint")


def _per_joint(value: Any) -> Any:
    listed = value.values() if isinstance(value, dict) else value
    if isinstance(value, (list, dict)) and value and all(map(_is_number, listed)):
        return value
    raise ValueError("must be a list with one number for each joint, or a table of joint = number")


def _paths(value: Any) -> Any:
    listed = list(value.values()) if isinstance(value, dict) else [value]
    if listed and all(isinstance(path, str) and path for path in listed):
        return value
    raise ValueError("must be a file, or a table of channel = file")


def _mask(value: Any) -> Any:
    if value == "auto" or (_is_number(value) and 0 <= value < 1):
        return value
    raise ValueError('must be "auto" or a share of the rated speed, from 0 (none) to below 1')


def _stages(value: Any) -> Any:
    stages = value if isinstance(value, list) else [value]
    if stages and all(type(stage) is int and stage >= 1 for stage in stages):
        return tuple(stages) if isinstance(value, list) else value
    raise ValueError("must be a whole factor, or a list with the factor of each stage")


def _edge(value: Any) -> Any:
    ends = value if isinstance(value, list) else [value, value]
    if len(ends) == 2 and all(type(end) is int and end >= 0 for end in ends):
        return tuple(value) if isinstance(value, list) else value
    raise ValueError("must be a number of samples, or a list of two: at the start and at the end")


def _motion_band(value: Any) -> Any:
    if value == "auto" or (_is_number(value) and value >= 0):
        return value
    raise ValueError('must be "auto" or a frequency in Hz, 0 for no band')


def _range(value: Any) -> Any:
    if isinstance(value, list) and len(value) == 2 and all(map(_is_number, value)):
        if value[0] < value[1]:
            return [float(end) for end in value]
        raise UnusableValue(
            "is empty", advice="the lower end comes first, and must be below the upper one"
        )
    raise ValueError("must be two numbers, [lowest, highest]")


def _masses(value: Any) -> Any:
    if _range(value)[0] >= 0:
        return _range(value)
    raise UnusableValue("begins below zero, and no body has such a mass", advice="begin at 0")


def _ellipsoid(value: Any) -> Any:
    if not (
        isinstance(value, list)
        and len(value) == 2
        and all(isinstance(part, list) and len(part) == 3 for part in value)
        and all(_is_number(x) for part in value for x in part)
    ):
        raise ValueError("must be [[x, y, z], [a, b, c]], centre and half axes")
    if min(value[1]) <= 0:
        raise UnusableValue(
            "has a half axis that is not positive", advice="use center_of_mass for a flat one"
        )
    return [[float(x) for x in part] for part in value]


def _below(folder: str) -> str:
    """A folder beside or below the file: one from elsewhere must not write where it likes."""
    path = PurePath(folder)
    if path.is_absolute() or path.drive or ".." in path.parts or not is_printable(folder):
        raise UnusableValue(
            "must lie beside or below this file, without '..'",
            advice="--out on the command line can name any other folder",
        )
    return folder


Numbers = Annotated[float | list[float], PlainValidator(_numbers)]
DriveGain = Annotated[float | list[float] | Literal["unknown"], PlainValidator(_drive_gain)]
PerJoint = Annotated[list[float] | dict[str, float], PlainValidator(_per_joint)]
Paths = Annotated[str | dict[str, str], PlainValidator(_paths)]
Mask = Annotated[Literal["auto"] | float, PlainValidator(_mask)]
PositiveNumbers = Annotated[float | tuple[float, ...], PlainValidator(_positive_numbers)]
Stages = Annotated[int | tuple[int, ...], PlainValidator(_stages)]
Edge = Annotated[int | tuple[int, int], PlainValidator(_edge)]
MotionBand = Annotated[Literal["auto"] | float, PlainValidator(_motion_band)]
Interval = Annotated[list[float], Field(min_length=2, max_length=2)]
Names = Annotated[list[str], Field(min_length=1)]
Range = Annotated[list[float], PlainValidator(_range)]
Ellipsoid = Annotated[list[list[float]], PlainValidator(_ellipsoid)]
Masses = Annotated[list[float], PlainValidator(_masses)]
Folder = Annotated[str, Field(min_length=1), AfterValidator(_below)]
