"""What the studio says of a key of the experiment file: the manual's words, without its links."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import replace

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from pivident.estimation.methods import METHODS
from pivident.experiment.file_lines import SHORT_FORMS, numbered
from pivident.experiment.manual import KeyWords, fields_of, table_in, words_of
from pivident.experiment.schema import ExperimentFile
from pivident.logs.units import UNITS_OF
from pivident.text.repair import Place
from pivident.text.toml_values import value_text

#: Where the manual sends its reader, which the page cannot.
_ELSEWHERE = re.compile(
    r"[,;]? see (\*[^*]+\*|`[^`]+\.md`|the list below|without torque|torque sensors|force sensors"
    r"|controllers that nobody knows|joint limits|how to|causes of model error)"
)


_LINK = re.compile(r"\[([^\]]*)\]\([^)]*\)")


def written_out(place: Sequence[int | str], value: str) -> Place:
    """The place of a key with the short forms written out: ``robot = "name"`` is a model."""
    place = numbered(place)
    if value.startswith("{"):
        return place
    return next((whole for whole, short in SHORT_FORMS.items() if short == place), place)


def words_of_key(place: Sequence[int | str]) -> KeyWords | None:
    """What is known of a key; None for one that the schema does not have."""
    words: KeyWords | None = None
    for model, name, field in _path(place):
        if field is None:
            return None
        words = _words(model, name, field)
    return words


def keys_of_table(place: Sequence[int | str]) -> tuple[str, ...]:
    """Keys that a table may have, in the order of the schema; none where any name is a key."""
    model: type[BaseModel] | None = ExperimentFile
    for _, _, field in _path(place):
        model = None if field is None else table_in(field.annotation)
    return () if model is None else tuple(fields_of(model))


def _path(
    place: Sequence[int | str],
) -> Iterator[tuple[type[BaseModel], str, FieldInfo | None]]:
    """Tables, keys and fields on the way to a place, as far as the schema knows the names.

    It ends at a table whose keys are names of joints, links or parameters.
    """
    model: type[BaseModel] | None = ExperimentFile
    for name in (part for part in place if isinstance(part, str)):
        if model is None:
            return
        field = fields_of(model).get(name)
        yield model, name, field
        model = None if field is None else table_in(field.annotation)


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


def _words(model: type[BaseModel], name: str, field: FieldInfo) -> KeyWords:
    """Words of a field, with the choices of units, sides and methods, which no type lists."""
    words = words_of(field)
    choices = words.choices
    if model.__name__ == "UnitsEntry" and name in UNITS_OF and name != "inputs":
        choices = tuple(unit for unit in UNITS_OF[name] if unit != "Nm")
    elif (model.__name__, name) == ("RecordingEntry", "side"):
        choices = ("joint", "motor")
    elif (model.__name__, name) == ("IdentifyEntry", "methods"):
        choices = tuple(METHODS)
    meaning = _ELSEWHERE.sub("", _LINK.sub(r"\1", words.meaning))
    return replace(words, meaning=meaning, choices=tuple(map(value_text, choices)))
