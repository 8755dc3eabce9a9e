"""Tables of an experiment file from declared options, see `pivident.options`.

This module needs pydantic and is imported only when a file is read.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from types import UnionType
from typing import Annotated, Any, Literal, TypeVar, Union, get_args, get_origin

from pydantic import Field, create_model
from pydantic.functional_validators import PlainValidator

from pivident.experiment.table_values import Edge, MotionBand, Names, PositiveNumbers, Stages
from pivident.options import (
    DECLARED,
    Option,
    Options,
    annotations_of,
    declarations,
    default_of,
)
from pivident.robot.mdh_schema import Entry, key
from pivident.text.toml_values import value_text

AnyEntry = TypeVar("AnyEntry", bound=Entry)


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
    return (entry, key(entry(), meaning, alias=alias))


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
