"""Values of an experiment file and tables of declared options: numbers, ranges, paths, defaults.

This module needs pydantic and is imported only when a file is read.

Tables of an experiment file from declared options, see `pivident.foundation.options`.

This module needs pydantic and is imported only when a file is read.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import PurePath
from types import UnionType
from typing import Annotated, Any, Literal, TypeVar, Union, get_args, get_origin

from pydantic import AfterValidator, Field, create_model
from pydantic.functional_validators import PlainValidator

from pivident.foundation.errors import UnusableValue
from pivident.foundation.options import (
    DECLARED,
    Option,
    Options,
    annotations_of,
    declarations,
    default_of,
)
from pivident.foundation.text.identifiers import is_printable
from pivident.foundation.text.toml import value_text
from pivident.loop.simulation.controllers import UNKNOWN_GAIN
from pivident.robot.mdh_keys import Entry, empty_table

AnyEntry = TypeVar("AnyEntry", bound=Entry)


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


def _horizon(value: Any) -> Any:
    if value in ("moves", "record") or (_is_number(value) and value > 0):
        return value
    raise ValueError('must be "record", "moves" or a positive number of seconds')


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
Horizon = Annotated[Literal["moves", "record"] | float, PlainValidator(_horizon)]
MotionBand = Annotated[Literal["auto"] | float, PlainValidator(_motion_band)]
Interval = Annotated[list[float], Field(min_length=2, max_length=2)]
Names = Annotated[list[str], Field(min_length=1)]
Range = Annotated[list[float], PlainValidator(_range)]
Ellipsoid = Annotated[list[list[float]], PlainValidator(_ellipsoid)]
Masses = Annotated[list[float], PlainValidator(_masses)]
Folder = Annotated[str, Field(min_length=1), AfterValidator(_below)]


def _fixed(value: Any) -> Any:
    if value == "description" or (isinstance(value, dict) and all(map(_is_number, value.values()))):
        return value
    raise ValueError('must be "description", or a table of parameter = number')


def _limits(value: Any) -> Any:
    """Two numbers for each name, either of them ``none``."""
    found = {
        name: tuple(None if x == "none" else x for x in pair)
        for name, pair in (value.items() if isinstance(value, dict) else ())
        if isinstance(pair, list) and len(pair) == 2
    }
    if not isinstance(value, dict) or not all(
        x is None or _is_number(x) for name in value for x in found.get(name, ("",))
    ):
        raise ValueError('must be a table of parameter = [least, largest], "none" for no bound')
    return found


def _expected(value: Any) -> Any:
    """A number and a standard deviation for each name."""
    if isinstance(value, dict) and all(
        isinstance(x, list) and len(x) == 2 and all(map(_is_number, x)) for x in value.values()
    ):
        return {name: tuple(map(float, pair)) for name, pair in value.items()}
    raise ValueError("must be a table of parameter = [expected value, standard deviation]")


Fixed = Annotated[Literal["description"] | dict[str, float], PlainValidator(_fixed)]
Limits = Annotated[dict[str, tuple[float | None, float | None]], PlainValidator(_limits)]
Expected = Annotated[dict[str, tuple[float, float]], PlainValidator(_expected)]


def _bounds(value: Any) -> Any:
    """A table of two numbers for each name."""
    if not isinstance(value, dict):
        raise ValueError("must be a table such as { fc1 = [0, 20] }")
    for name, pair in value.items():
        numbers = isinstance(pair, list) and len(pair) == 2
        if not numbers or not all(type(x) in (int, float) for x in pair) or not pair[0] < pair[1]:
            raise ValueError(f"{name} needs two numbers, the lower one first, not {pair!r}")
    return value


#: Types of values in a file, by those of the options where the two differ.
IN_A_FILE: dict[frozenset[Any], Any] = {
    frozenset({float, tuple[float, ...]}): PositiveNumbers,
    frozenset({int, tuple[int, ...]}): Stages,
    frozenset({int, tuple[int, int]}): Edge,
    frozenset({Literal["auto"], float}): MotionBand,
    frozenset({Literal["moves", "record"], float}): Horizon,
    frozenset({tuple[str, ...]}): Names,
    frozenset({Mapping[str, float]}): dict[str, float],
    frozenset({Mapping[str, tuple[float, float]]}): Annotated[
        dict[str, list[float]], PlainValidator(_bounds)
    ],
    frozenset({tuple[tuple[float, ...], ...]}): list[list[float]],
}


def entry_of(
    *kinds: type[Options],
    keys: Iterable[str] | None = None,
    base: type[Entry] = Entry,
    name: str = "",
    further: Mapping[str, Any] | None = None,
    module: str = __name__,
) -> type[Entry]:
    """Schema of a table with the declared options of a class, or of several; none is required.

    Args:
        *kinds: classes of options.
        keys: options that the table has; None: all.
        base: what the schema adds to.
        name: name of the schema; empty: that of the class.
        further: other fields, as `pydantic.create_model` takes them.
        module: the module that has the schema under its name, so that other processes find it.
    """
    fields: dict[str, Any] = {}
    for kind in kinds:
        for name_of_key, declared in declarations(kind).items():
            if keys is None or name_of_key in keys:
                annotation = value_type(annotations_of(kind)[name_of_key], declared)
                default = default_of(kind, name_of_key)
                shown = declared.shown or (
                    "none" if default is None else f"`{value_text(default)}`"
                )
                words: Any = {DECLARED: replace(declared, shown=shown)}
                fields[name_of_key] = (annotation | None, Field(None, json_schema_extra=words))
    title = name or f"{kinds[0].__name__}Entry"
    entry = create_model(title, __base__=base, __module__=module, **fields, **(further or {}))
    entry.__doc__ = f"Options of `{kinds[0].__module__}.{kinds[0].__name__}`."
    return entry


def table_of(entry: type[Entry], meaning: str, alias: str | None = None) -> Any:
    """A field that holds a table, empty where a file has none, as `create_model` takes it."""
    return (entry, empty_table(entry, meaning, alias=alias))


def value_type(annotation: Any, declared: Option) -> Any:
    """Type of an option's value in a file, with its limits."""
    union = get_origin(annotation) in (Union, UnionType)
    types = frozenset(get_args(annotation) if union else (annotation,)) - {type(None)}
    if types in IN_A_FILE:
        return IN_A_FILE[types]
    (alone,) = types
    limits = {
        "ge": declared.at_least, "le": declared.at_most, "gt": declared.above, "lt": declared.below,
    }  # fmt: skip
    given: dict[str, Any] = {key: value for key, value in limits.items() if value is not None}
    return Annotated[alone, Field(**given)] if given else alone
