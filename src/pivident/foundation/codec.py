"""Dataclasses from JSON: what `plain` has written is read back by the annotations of the fields.

    @dataclass(frozen=True, eq=False)
    class Pose:
        rotation: Annotated[np.ndarray, Sized(3, 3)]
        translation: Annotated[np.ndarray, Sized(3)]

    decode(Pose, {"rotation": [[1.0, 0.0, 0.0], …], "translation": [0.0, 0.0, 0.1]})

The content may be anybody's: unknown and missing keys, other types, NaN and infinite numbers are
refused, with the place of the first. What types do not say is said by marks in the annotations, see
`pivident.foundation.text.plain_values`. A class that sets ``passes_over_others`` describes a part
of a table. A `Layout` is a kind of file, with its version.

The schema is that of pydantic_core, the machine of pydantic. Pydantic's own of a dataclass would
pass over unknown keys, refuse the lists of JSON where tuples are annotated, and take no arrays.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, is_dataclass
from functools import cache
from pathlib import Path
from types import UnionType
from typing import (
    Annotated,
    Any,
    Literal,
    Union,
    get_args,
    get_origin,
    get_type_hints,
    is_typeddict,
)

import numpy as np
from pydantic_core import CoreSchema, SchemaValidator, ValidationError, core_schema as core

from pivident.foundation.errors import (
    Advised,
    IdentificationFileError,
    PividentError,
    UnusableValue,
)
from pivident.foundation.files import json_object
from pivident.foundation.text.plain_values import (
    BY_NAME,
    INFINITE_IN_WORDS,
    As,
    Limits,
    Null,
    Sized,
    stored_fields,
)

#: Content of a file as plain values.
Content = dict[str, Any]

#: Longest value that a message shows.
MAX_SHOWN = 60


def decode(kind: Any, content: Any, **sizes: int) -> Any:
    """Plain values as an object.

    Args:
        kind: its class, or another annotation.
        content: what a file holds.
        **sizes: sizes of its arrays that are known, by the names in their shapes.

    Returns:
        The object.

    Raises:
        UnusableValue: names the first key that is wrong, its value, and what it has to be.
    """
    try:
        return _validator(kind).validate_python(content, context=sizes)
    except ValidationError as error:
        raise first_problem(error) from None


def first_problem(error: ValidationError) -> UnusableValue:
    """The first problem of content: place, value, what was expected, what to do."""
    problems = error.errors(include_url=False)
    first = problems[0]
    where = ".".join(str(part) for part in first["loc"]) or "the content"
    value = first["input"]
    is_long = isinstance(value, (str, list, dict)) and len(value) > MAX_SHOWN
    shown = "" if is_long or first["type"] == "missing" else f" = {value!r}"
    shown = shown if len(shown) <= MAX_SHOWN + 3 else ""
    said = first.get("ctx", {}).get("error")
    if not isinstance(said, Advised):
        message = first["msg"].removeprefix("Value error, ").replace("Input should be", "must be")
        said = UnusableValue(f"{message[:1].lower()}{message[1:]}")
    fact = f"{where}{shown}: {said.fact}"
    more = f" (and {len(problems) - 1} more)" if len(problems) > 1 else ""
    return UnusableValue(fact, advice=said.advice).followed_by(more)


@cache
def _validator(annotation: Any) -> SchemaValidator:
    return SchemaValidator(_schema(annotation))


def _schema(annotation: Any, marks: tuple[Any, ...] = ()) -> CoreSchema:
    """Schema of an annotation with the marks that stand around it."""
    if get_origin(annotation) is Annotated:
        return _schema(annotation.__origin__, (*marks, *annotation.__metadata__))
    of_numbers = tuple(m for m in marks if isinstance(m, Null) or m == INFINITE_IN_WORDS)
    shapes = [mark for mark in marks if isinstance(mark, Sized)]
    for mark in marks:
        if isinstance(mark, As):
            form = _schema(mark.form, of_numbers)
            return _with_size(core.no_info_after_validator_function(mark.read, form), shapes)
    limits = {key: x for m in marks if isinstance(m, Limits) for key, x in m.limits.items()}
    origin, parts = get_origin(annotation), get_args(annotation)
    if origin in (Union, UnionType):
        others: list[Any] = [_schema(part, marks) for part in parts if part is not type(None)]
        union = others[0] if len(others) == 1 else core.union_schema(others)
        return union if len(others) == len(parts) else core.nullable_schema(union)
    if annotation is np.ndarray:
        return _array(shapes[0], of_numbers, limits)
    if annotation is float:
        return _number(of_numbers, limits)
    if annotation in SIMPLE:
        return SIMPLE[annotation](strict=True, **limits)
    if annotation in BY_NAME:
        return core.no_info_after_validator_function(
            BY_NAME[annotation], core.str_schema(strict=True)
        )
    if is_dataclass(annotation) or is_typeddict(annotation):
        return _table(annotation)
    if origin is Literal:
        return core.literal_schema(list(parts))
    inner = [_schema(part, of_numbers) for part in parts if part is not ...]
    if origin is tuple:
        return _with_size(_tuple(inner, parts[-1] is ..., limits), shapes)
    if origin is list:
        return _list(*inner, **limits)
    if origin in (dict, Mapping):
        return core.dict_schema(*inner, strict=True)
    if annotation is not Any:
        raise TypeError(f"{annotation} is nothing that a file can hold")
    return core.any_schema()


#: Schemas of what JSON has.
SIMPLE: dict[Any, Callable[..., Any]] = {
    str: core.str_schema,
    int: core.int_schema,
    bool: core.bool_schema,
}


def _number(marks: Sequence[Any], limits: Mapping[str, Any]) -> CoreSchema:
    """A finite number, and what stands for others."""
    if not marks:
        return core.float_schema(strict=True, allow_inf_nan=False, **limits)
    if isinstance(marks[-1], Null):
        finite = core.nullable_schema(_number((), limits))
        known = marks[-1].number
        return core.no_info_after_validator_function(lambda x: known if x is None else x, finite)
    number = core.no_info_after_validator_function(_not_nan, core.float_schema(strict=True))
    return core.no_info_before_validator_function(_number_or_infinity, number)


def _number_or_infinity(value: Any) -> Any:
    return {"inf": math.inf, "-inf": -math.inf}.get(value, value) if type(value) is str else value


def _not_nan(value: float) -> float:
    if math.isnan(value):
        raise ValueError("must be a number or infinite, not NaN")
    return value


def _table(kind: Any) -> CoreSchema:
    """A JSON object with the keys of a class, others only where it passes over them."""
    if is_typeddict(kind):
        hints = get_type_hints(kind, include_extras=True).items()
        own = {key: (_schema(hint), key in kind.__required_keys__) for key, hint in hints}
    else:
        own = {f.key: (_schema(f.annotation), not f.optional) for f in stored_fields(kind)}
    fields = {key: core.typed_dict_field(x, required=needed) for key, (x, needed) in own.items()}
    others: Any = "ignore" if getattr(kind, "passes_over_others", False) else "forbid"
    table = core.typed_dict_schema(fields, strict=True, extra_behavior=others)
    if is_typeddict(kind):
        return table
    renamed = {f.key: f.name for f in stored_fields(kind) if f.key != f.name}
    return core.no_info_after_validator_function(
        (lambda values: kind(**{renamed.get(key, key): x for key, x in values.items()}))
        if renamed
        else (lambda values: kind(**values)),
        table,
    )


def _list(entries: CoreSchema | None = None, **limits: Any) -> CoreSchema:
    """A list; its first wrong entry is enough, of millions all would not fit into the memory."""
    return core.list_schema(entries, strict=True, fail_fast=True, **limits)


def _tuple(
    entries: Sequence[CoreSchema], any_number: bool, limits: Mapping[str, Any]
) -> CoreSchema:
    """A list of entries of one kind, or of one for each schema."""
    if any_number:
        found = _list(entries[0], **limits)
        return core.no_info_after_validator_function(tuple, found)
    found = _list(**_length(len(entries)))
    made = core.no_info_after_validator_function(tuple, found)
    return core.chain_schema([made, core.tuple_schema(list(entries), strict=True)])


def _with_size(schema: CoreSchema, shapes: Sequence[Sized]) -> CoreSchema:
    """A schema whose values, arrays or tuples, have a shape with names."""
    if not any(isinstance(size, str) for shape in shapes for size in shape.sizes):
        return schema
    return core.with_info_after_validator_function(
        lambda x, info: _sized(x, getattr(x, "shape", (len(x),)), shapes[0].sizes, info), schema
    )


def _array(shape: Sized, marks: Sequence[Any], limits: Mapping[str, Any]) -> CoreSchema:
    """An array of numbers; those that are null have the number of their mark."""
    entry: CoreSchema = core.bool_schema(strict=True)
    if shape.of is float:
        entry = core.float_schema(strict=True, allow_inf_nan=False)
        entry = core.nullable_schema(entry) if marks else entry
    for size in shape.sizes[:0:-1]:
        entry = _list(entry, **_length(size))
    entry = _list(entry, **_length(shape.sizes[0]), **limits)

    def made(rows: list[Any]) -> np.ndarray:
        lengths = sorted({len(row) for row in rows}) if len(shape.sizes) > 1 else []
        if len(lengths) > 1:
            raise UnusableValue(
                f"{len(rows)} rows of {' or '.join(map(str, lengths))} numbers",
                advice="rows of the same length are needed",
            )
        array: np.ndarray = np.array(rows, dtype=shape.of)
        if marks:
            array[np.isnan(array)] = marks[-1].number
        return array if rows else array.reshape((0,) * len(shape.sizes))

    return _with_size(core.no_info_after_validator_function(made, entry), [shape])


def _length(size: int | str | None) -> dict[str, Any]:
    return {"min_length": size, "max_length": size} if isinstance(size, int) else {}


def _sized(
    value: Any, found: tuple[int, ...], sizes: Sequence[int | str | None], info: core.ValidationInfo
) -> Any:
    """The value, once its sizes are those that have these names elsewhere."""
    known: dict[str, int] = info.context  # type: ignore[assignment]
    wanted = tuple(
        known.setdefault(name, size) if isinstance(name, str) else size
        for name, size in zip(sizes, found, strict=True)
    )
    if wanted != found:
        named = dict.fromkeys(f"{known[n]} {n}" for n in sizes if isinstance(n, str))
        raise UnusableValue(
            f"has shape {found}", advice=f"{' and '.join(named)} need shape {wanted}"
        )
    return value


@dataclass(frozen=True)
class Layout:
    """A kind of file: how it is known, which versions of it there are, and how one gets another.

    Attributes:
        noun: what it is, such as ``design``.
        version: newest version, which is written.
        give: which file is meant, a half sentence of advice.
        again: how it is made anew, likewise.
        name: what its key ``format`` says; empty: it has no such key.
        error: class of its errors.
        max_bytes: larger files are none of this kind.
        older: what makes content of a version that of the next one, by the version.
    """

    noun: str
    version: int
    give: str
    again: str
    name: str = ""
    error: type[IdentificationFileError] = IdentificationFileError
    max_bytes: int = 2**27
    older: Mapping[int, Callable[[Content], Content]] = field(default_factory=dict)

    @property
    def header(self) -> Content:
        """What its content begins with."""
        return ({"format": self.name} if self.name else {}) | {"schema": self.version}

    def json(self, file: Path, advice: str = "check the path and its permissions") -> Content:
        """A file as plain values, of this kind or another one; ``advice``: if it cannot be read."""
        try:
            return json_object(file, self.max_bytes)
        except OSError as error:
            fact = f"cannot be read ({error.strerror})"
            raise self.error(str(file), fact, advice=advice) from error
        except ValueError as error:
            again = f"{self.give}, or {self.again}"
            raise self.error(str(file), str(error), advice=again) from None

    def raised(self, content: Content, file: str) -> Content:
        """Content as that of the newest version, without its header; ``file``: its name."""
        kind, version = content.get("format", ""), content.get("schema")
        if kind != self.name:
            fact = f"is no {self.noun}: its format is {kind!r}, not {self.name!r}"
            raise self.error(file, fact, advice=self.give)
        if type(version) is not int or version not in (self.version, *self.older):
            newer = type(version) is int and version > self.version
            reads = f"{'up to ' if self.older else ''}{self.version}"
            fact = f"has layout {version!r}, this version reads {reads}"
            advice = "install a newer pivident" if newer else self.again
            raise self.error(file, fact, advice=advice)
        with self.damage(file):
            for number in range(version, self.version):
                try:
                    content = self.older[number](content)
                except (AttributeError, IndexError, KeyError, TypeError):
                    raise ValueError(f"is no {self.noun} of layout {number}") from None
        return {key: x for key, x in content.items() if key not in self.header}

    @contextmanager
    def damage(self, file: str) -> Iterator[None]:
        """Errors about content from inside are those of its file."""
        try:
            yield
        except IdentificationFileError:
            raise
        except (PividentError, ValueError, ArithmeticError) as error:
            advice = f"the file is damaged or was changed by hand, {self.again}"
            raise self.error.of_content(file, error, advice) from None
