"""Results as plain values, as CSV, and as strict JSON: numbers that are not finite are null.

A dataclass is an object of its fields. What their types do not say is said by marks in their
annotations, by which `pivident.foundation.codec.decode` reads them back:

    class Joint:
        name: Name
        rotation: Annotated[np.ndarray, Sized(3, 3)]
        rated_speed: Annotated[float | None, INFINITE_IN_WORDS] = None
        motion: Annotated[JointMotion, LATER] = "driven"
"""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, fields, is_dataclass
from functools import cache
from pathlib import Path
from types import UnionType
from typing import Annotated, Any, Union, get_args, get_origin, get_type_hints


@dataclass(frozen=True)
class Null:
    """Mark of numbers that are null where they are not finite: the number that null stands for."""

    number: float


#: Mark of numbers that are ``"inf"`` and ``"-inf"`` where they are infinite.
INFINITE_IN_WORDS = "infinite in words"


class Limits:
    """Mark of what a value has to be: ``ge``, ``gt``, ``le``, ``lt``, ``min_length`` ….

    Args:
        **limits: as pydantic names them.
    """

    def __init__(self, **limits: Any) -> None:
        self.limits = limits


class Sized:
    """Mark of an array, or of how many entries a tuple has.

    Args:
        *sizes: along each axis; None: any. Sizes of one name are equal in a file.
        of: type of the elements.
    """

    def __init__(self, *sizes: int | str | None, of: type = float) -> None:
        self.sizes, self.of = sizes, of


@dataclass(frozen=True)
class As:
    """Mark of a value that is stored in another form.

    Attributes:
        form: annotation of what is stored.
        write: makes it of the value.
        read: makes the value of it; what it refuses is a ValueError.
    """

    form: Any
    write: Callable[[Any], Any]
    read: Callable[[Any], Any]


@dataclass(frozen=True)
class Called:
    """Mark of a field with another key."""

    key: str


#: Marks of a field that files of earlier versions lack, of one that is left out where it is empty,
#: and of one that is not stored: its default holds.
LATER, SPARSE, NOT_STORED = "later", "sparse", "not stored"

#: A number that may not be known, and a name.
Known = Annotated[float, Null(math.nan)]
Name = Annotated[str, Limits(max_length=1000)]

#: Classes whose objects are stored by their ``name``, and what finds them by it.
BY_NAME: dict[type, Callable[[str], Any]] = {}


@dataclass(frozen=True)
class StoredField:
    """A field of a dataclass as its file has it."""

    name: str
    annotation: Any
    key: str
    optional: bool  # whether a file may lack it
    sparse: bool  # whether it is left out where it is empty
    write: Callable[[Any], Any]  # makes its stored form
    in_words: bool  # whether infinite numbers are


@cache
def stored_fields(kind: type) -> tuple[StoredField, ...]:
    """Fields of a dataclass in their order, but those that it does not print, as drawn arrays.

    Args:
        kind: the dataclass.
    """
    annotations = get_type_hints(kind, include_extras=True)
    return tuple(
        _stored_field(field.name, annotations[field.name])
        for field in fields(kind)
        if field.repr and NOT_STORED not in marks_of(annotations[field.name])
    )


def marks_of(annotation: Any) -> tuple[Any, ...]:
    """Marks that stand in an annotation, and in its part beside None."""
    if get_origin(annotation) is Annotated:
        return (*annotation.__metadata__, *marks_of(annotation.__origin__))
    if get_origin(annotation) not in (Union, UnionType):
        return ()
    return tuple(mark for part in get_args(annotation) for mark in marks_of(part))


def _stored_field(name: str, annotation: Any) -> StoredField:
    marks = marks_of(annotation)
    forms = [mark.write for mark in marks if isinstance(mark, As)]
    return StoredField(
        name,
        annotation,
        next((mark.key for mark in marks if isinstance(mark, Called)), name),
        LATER in marks or SPARSE in marks,
        SPARSE in marks,
        lambda value: forms[0](value) if forms and value is not None else value,
        INFINITE_IN_WORDS in marks,
    )


def plain(value: Any, in_words: bool = False) -> Any:
    """Lists, dictionaries, texts and finite numbers; anything else as its text.

    Of a dataclass its stored fields, in their order. ``in_words``: infinite numbers as their text,
    not as None.
    """
    if isinstance(value, float):  # most values are
        return float(value) if math.isfinite(value) else str(value) if in_words else None
    if value is None or isinstance(value, bool | int | str):
        return value
    if hasattr(value, "tolist"):  # an array or number of NumPy, which is heavy to import
        import numpy as np

        finite = value.dtype.kind in "biuf" and np.isfinite(value).all()
        return value.tolist() if finite else plain(value.tolist(), in_words)
    if type(value) in BY_NAME:
        return value.name
    if is_dataclass(value) and not isinstance(value, type):
        own = ((f, f.write(getattr(value, f.name))) for f in stored_fields(type(value)))
        return {f.key: plain(entry, f.in_words) for f, entry in own if not f.sparse or entry}
    if isinstance(value, Mapping):
        return {str(key): plain(entry, in_words) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [plain(entry, in_words) for entry in value]
    return str(value)


def lists_as_tuples(value: Any) -> Any:
    """What was read of a file, with tuples for lists, so that it can be compared and hashed."""
    return tuple(map(lists_as_tuples, value)) if isinstance(value, list) else value


def strict_json(value: Any) -> str:
    """JSON on one line."""
    return json.dumps(value, allow_nan=False, ensure_ascii=False)


def json_of_entries(content: Mapping[str, Any]) -> str:
    """A JSON object with a line for each key, and for each element of a list."""
    entries = []
    for key, value in content.items():
        if isinstance(value, list) and value:
            text = "[\n    " + ",\n    ".join(map(strict_json, value)) + "\n  ]"
        else:
            text = strict_json(value)
        entries.append(f"  {strict_json(key)}: {text}")
    return "{\n" + ",\n".join(entries) + "\n}\n"


def csv_table(columns: Iterable[str], rows: Iterable[Iterable[Any]]) -> str:
    """A table with its header as comma-separated values; None is left empty."""
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(columns)
    writer.writerows(rows)
    return stream.getvalue()


def write_json(path: Path, content: Any) -> None:
    """Write plain values as JSON; file names in it may hold bytes that are no text."""
    text = json.dumps(content, indent=1, ensure_ascii=False, allow_nan=False)
    path.write_text(text, encoding="utf-8", errors="backslashreplace")
