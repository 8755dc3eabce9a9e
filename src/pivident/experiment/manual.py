"""What the manual says of a key of the experiment file, from its declaration in the schema.

``docs/experiment_file.md`` and the studio show the same words.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from types import UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from pivident.foundation.options import Option, literals
from pivident.foundation.text.toml import value_text
from pivident.robot.mdh_keys import LaterTable, declared_of, fields_of

#: What a value is called, by its type.
KINDS: dict[Any, str] = {bool: "bool", int: "number", float: "number", str: "text", dict: "table"}


@dataclass(frozen=True)
class KeyWords:
    """What is said of a key.

    Attributes:
        kind: type, in the manual's words, such as ``number`` or ``list of names``.
        default: in the manual's words.
        unit: unit of the value, empty without one.
        meaning: what it is, with links as Markdown has them.
        choices: possible values, where they are a fixed list.
        is_table: whether it is a table with keys of its own.
    """

    kind: str = ""
    default: str = ""
    unit: str = ""
    meaning: str = ""
    choices: tuple[Any, ...] = ()
    is_table: bool = False


def words_of(field: FieldInfo) -> KeyWords:
    """What is said of a field of a table."""
    declared = declared_of(field) or Option("")
    table = table_in(field.annotation)
    return KeyWords(
        declared.kind or kind_of(field.annotation),
        declared.shown or shown_of(field),
        declared.unit,
        declared.meaning,
        literals(_bare(field.annotation)),
        table is not None and get_origin(_bare(field.annotation)) is not list,
    )


def kind_of(annotation: Any) -> str:
    """Type of a value in words; empty where nothing short says it."""
    bare = _bare(annotation)
    origin = get_origin(bare) or bare
    if origin is Literal:
        return "name"
    if isinstance(bare, type) and issubclass(bare, BaseModel):
        return "table"
    if origin is list:
        (inner,) = get_args(bare)
        return f"list of {'tables' if table_in(inner) else 'names'}"
    return KINDS.get(origin, "")


def shown_of(field: FieldInfo) -> str:
    """Default of a field in words."""
    if field.is_required():
        return "needed"
    value = field.get_default(call_default_factory=True)
    if value is None:
        return "none"
    return "`{}`" if isinstance(value, BaseModel) else f"`{value_text(value)}`"


def table_in(annotation: Any) -> type[BaseModel] | None:
    """The table of a key, or of each element of its list."""
    bare = _bare(annotation)
    if isinstance(bare, LaterTable):
        return bare.entry
    if isinstance(bare, type) and issubclass(bare, BaseModel):
        return bare
    inner = get_args(bare) if get_origin(bare) in (list, Union, UnionType) else ()
    return next((table for table in map(table_in, inner) if table is not None), None)


def rows_of(model: type[BaseModel]) -> Iterator[str]:
    """The manual's table of a model, line by line."""
    yield "| key | type | default | unit | meaning |"
    yield "|---|---|---|---|---|"
    for name, field in fields_of(model).items():
        words = words_of(field)
        cells: Sequence[str] = (
            f"`{name}`", words.kind, words.default, words.unit or "–", words.meaning,
        )  # fmt: skip
        yield f"| {' | '.join(cells)} |"


def _bare(annotation: Any) -> Any:
    """A type without its limits, and without None beside it."""
    if get_origin(annotation) is Annotated:
        return _bare(get_args(annotation)[0])
    if get_origin(annotation) in (Union, UnionType):
        others = [inner for inner in get_args(annotation) if inner is not type(None)]
        return _bare(others[0]) if len(others) == 1 else Union[tuple(others)]  # noqa: UP007
    return annotation
