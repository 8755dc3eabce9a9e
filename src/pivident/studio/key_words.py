"""What is known of a key of the experiment file: its table in the schema, and the manual's words.

``experiment_keys.json`` holds the tables of ``docs/experiment_file.md``; ``tools`` writes it.
"""

from __future__ import annotations

import json
import re
import types
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from importlib import resources
from typing import Annotated, Any, Literal, Union, get_args, get_origin

from pydantic import BaseModel

from pivident.estimation.methods import METHODS
from pivident.experiment.schema import ExperimentFile
from pivident.init.experiment_text import value_text
from pivident.logs.units import UNITS_OF
from pivident.text.toml_places import Place

#: Short forms of a file: where the key of a table stands that is written as its value.
SHORT_FORMS: dict[Place, Place] = {
    ("robot", "model"): ("robot",),
    ("controller", "type"): ("controller",),
    ("controller", "reference"): ("reference",),
}


#: Where the manual sends its reader, which the page cannot.
_ELSEWHERE = re.compile(
    r"[,;]? see (\*[^*]+\*|`[^`]+\.md`|the list below|without torque|torque sensors|force sensors"
    r"|controllers that nobody knows|joint limits|how to|causes of model error)"
)


@dataclass(frozen=True)
class KeyWords:
    """What the manual says about a key.

    Attributes:
        kind: type, in the manual's words, such as ``number`` or ``list of names``.
        default: in the manual's words.
        unit: unit of the value, empty without one.
        meaning: what it is.
        choices: possible values as TOML, where they are a fixed list.
        is_table: whether it is a table with keys of its own.
    """

    kind: str = ""
    default: str = ""
    unit: str = ""
    meaning: str = ""
    choices: tuple[str, ...] = ()
    is_table: bool = False


def numbered(place: Sequence[int | str]) -> Place:
    """A place as the check has it: the only recording is number 0."""
    place = tuple(place)
    if place[:1] == ("recording",) and not isinstance((*place, "")[1], int):
        return ("recording", 0, *place[1:])
    return place


def written_out(place: Sequence[int | str], value: str) -> Place:
    """The place of a key with the short forms written out: ``robot = "name"`` is a model."""
    place = numbered(place)
    if value.startswith("{"):
        return place
    return next((whole for whole, short in SHORT_FORMS.items() if short == place), place)


def words_of_key(place: Sequence[int | str]) -> KeyWords | None:
    """What is known of a key; None for one that the schema does not have."""
    names = [part for part in place if isinstance(part, str)]
    model: type[BaseModel] | None = ExperimentFile
    words: KeyWords | None = None
    for name in names:
        if model is None:  # a table whose keys are names of joints, links or parameters
            return words
        field = _fields(model).get(name)
        if field is None:
            return None
        words = _words(model, name, field.annotation)
        model = _table_in(field.annotation)
    return words


def keys_of_table(place: Sequence[int | str]) -> tuple[str, ...]:
    """Keys that a table may have, in the order of the schema; none where any name is a key."""
    model: type[BaseModel] | None = ExperimentFile
    for name in (part for part in place if isinstance(part, str)):
        field = _fields(model).get(name) if model is not None else None
        model = None if field is None else _table_in(field.annotation)
    return () if model is None else tuple(_fields(model))


def example_of(words: KeyWords) -> str:
    """A value that a key may have, as TOML."""
    default = words.default.strip("`")
    if words.choices:
        return next((c for c in words.choices if c != default), words.choices[0])
    if words.kind.startswith("number") or words.kind == "per joint":
        return default if _is_number(default) else "1.0"
    count = words.kind.partition(" ")[0]
    if count.isdigit() and words.kind.endswith("numbers"):
        return value_text([float(k) for k in range(int(count))])
    made = {"list of names": '["name"]', "list of numbers": "[0.0]", "columns": '["column"]'}
    return made.get(words.kind, "{}" if words.kind.startswith("table") else '""')


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


@cache
def _documented() -> dict[str, dict[str, dict[str, str]]]:
    """Tables of the manual by the classes of the schema."""
    file = resources.files("pivident.studio") / "experiment_keys.json"
    return dict(json.loads(file.read_text(encoding="utf-8")))


def _fields(model: type[BaseModel]) -> dict[str, Any]:
    return {field.alias or name: field for name, field in model.model_fields.items()}


def _words(model: type[BaseModel], name: str, annotation: Any) -> KeyWords:
    said = _documented().get(model.__name__, {}).get(name, {})
    choices = _choices(model, name, annotation)
    return KeyWords(
        said.get("type", ""),
        said.get("default", ""),
        said.get("unit", ""),
        _ELSEWHERE.sub("", said.get("meaning", "")),
        tuple(value_text(choice) for choice in choices),
        is_table=_is_table(annotation),
    )


def _choices(model: type[BaseModel], name: str, annotation: Any) -> tuple[Any, ...]:
    """Values of a fixed list, those of units and sides included."""
    if model.__name__ == "UnitsEntry" and name in UNITS_OF and name != "inputs":
        return tuple(unit for unit in UNITS_OF[name] if unit != "Nm")
    if model.__name__ == "RecordingEntry" and name == "side":
        return ("joint", "motor")
    if model.__name__ == "IdentifyEntry" and name == "methods":
        return tuple(METHODS)
    return _literals(annotation)


def _literals(annotation: Any) -> tuple[Any, ...]:
    """Values of a Literal, of it or None, and of a truth value."""
    if annotation is bool:
        return (True, False)
    if get_origin(annotation) is Literal:
        return get_args(annotation)
    if get_origin(annotation) in (Union, types.UnionType, Annotated):
        return tuple(x for inner in get_args(annotation) for x in _literals(inner))
    return ()


def _is_table(annotation: Any) -> bool:
    """Whether a value is a table with keys of its own, not a list of such."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return True
    inside = get_origin(annotation) in (Union, types.UnionType, Annotated)
    return inside and any(map(_is_table, get_args(annotation)))


def _table_in(annotation: Any) -> type[BaseModel] | None:
    """The table of a key, or of each element of its list."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    if get_origin(annotation) not in (Union, types.UnionType, Annotated, list):
        return None
    return next((m for m in map(_table_in, get_args(annotation)) if m is not None), None)
