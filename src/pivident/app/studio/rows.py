"""The lines of an experiment file as rows of a table, each with its reason and its meaning.

What is said of a key is in the manual's words, without its links.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

from pydantic import BaseModel
from pydantic.fields import FieldInfo
from tomlkit.items import InlineTable, Item

from pivident.data.logs.tables.dialect import is_number
from pivident.data.logs.units import UNITS_OF
from pivident.estimation.methods import METHODS
from pivident.experiment.edited_lines import document_of, table_name
from pivident.experiment.file_keys import ExperimentFile
from pivident.experiment.file_lines import SHORT_FORMS, file_lines, numbered, sureness
from pivident.experiment.manual import KeyWords, table_in, words_of
from pivident.foundation.text.repair import Place
from pivident.foundation.text.toml import keys_in, value_text
from pivident.robot.mdh_keys import fields_of

#: Signal that a key of a recording is about.
CHANNEL = {
    "rate": "t", "resample": "t", "part": "t", "control_rate": "t", "side": "q",
    "position_offset": "q", "allow_constant": "q", "torque_side": "tau", "torque_timing": "tau",
    "delay": "tau", "drive_delay": "tau", "saturation": "tau",
}  # fmt: skip

#: Tables whose missing keys are offered, with those that recordings and methods need most.
OFFERED: tuple[Place, ...] = (
    ("robot",),
    ("recording", 0),
    ("recording", 0, "columns"),
    ("recording", 0, "units"),
    ("controller",),
    ("identify",),
    ("validation",),
    ("output",),
    ("consistency",),
)


@dataclass(frozen=True)
class Row:
    """A key of the file, or one that it could have.

    Attributes:
        place: tables and keys as the check has them: the only recording is number 0.
        table: name of its table, such as ``recording.units``.
        key: its key there.
        value: its value as TOML; None where it is only suggested.
        example: a value that it could have, as TOML.
        sure: ``certain``, ``likely`` or ``assumed`` as `pivident init` has written; ``given`` by
            somebody; empty where there is no value.
        reason: the comment above it.
        correct: how to correct it, of that comment.
        meaning: what the manual says.
        unit: its unit.
        kind: its type in the manual's words; empty for a key that is not known.
        choices: possible values as TOML, where they are a fixed list.
        channel: the signal that it is about: ``q``, ``tau``, ``t`` …; empty for none.
    """

    place: Place
    table: str
    key: str
    value: str | None
    example: str
    sure: str
    reason: str
    correct: str
    meaning: str
    unit: str
    kind: str
    choices: tuple[str, ...]
    channel: str


def experiment_rows(text: str) -> tuple[Row, ...]:
    """Keys of a file and those that its comments suggest, in the order of the text.

    Raises:
        ExperimentError: the text is not TOML.
    """
    rows: list[Row] = []
    for line in file_lines(document_of(text, to_write=False)):
        words = words_of_key(line.place)
        if line.example is None:
            rows += _rows_of(line.place, line.value, line.reason)
        elif words is not None:
            rows.append(_row(line.place, None, line.example, line.reason, words))
    shown = {row.place: row for row in reversed(rows)}
    shown |= {row.place: row for row in rows if row.value is not None}
    return tuple(row for row in rows if row is shown[row.place])


def _rows_of(place: Place, value: Item, reason: str) -> Iterator[Row]:
    """The row of a value, or those of the keys in it where it is a table of the schema."""
    written = value.as_string()
    place = written_out(place, written)
    words = words_of_key(place)
    if isinstance(value, InlineTable) and words is not None and words.is_table:
        for parts, _, item in keys_in(value):
            yield from _rows_of((*place, *parts), item, reason)
    else:
        yield _row(place, written, "", reason, words)


def addable(text: str) -> tuple[Row, ...]:
    """Keys of the schema that a file neither has nor suggests.

    Raises:
        ExperimentError: the text is not TOML.
    """
    present = {row.place for row in experiment_rows(text)}
    rows = []
    for table in OFFERED:
        for key in keys_of_table(table):
            place = (*table, key)
            words = words_of_key(place)
            if words is None or words.is_table or words.kind.endswith("tables"):
                continue
            if any(p[: len(place)] == place for p in present):
                continue
            rows.append(_row(place, None, example_of(words), "", words))
    return tuple(rows)


def _row(
    place: Place, value: str | None, example: str, comment: str, words: KeyWords | None
) -> Row:
    sure, reason, correct = sureness(comment)
    known = words or KeyWords()
    return Row(
        place,
        table_name(place),
        str(place[-1]),
        value,
        example or example_of(known),
        "" if value is None else sure,
        reason,
        correct,
        known.meaning,
        known.unit,
        known.kind,
        known.choices,
        channel_of(place),
    )


def channel_of(place: Place) -> str:
    """The signal that a key is about; empty for none."""
    names = [part for part in place if isinstance(part, str)]
    if "recording" in names:
        below = names[names.index("recording") + 1 :]
        if below[:1] in (["columns"], ["units"]):
            return below[1] if len(below) > 1 else ""
        return CHANNEL.get(below[0], "") if below else ""
    return "q_ref" if names[0] == "controller" else ""


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
        return default if is_number(default) else "1.0"
    count = words.kind.partition(" ")[0]
    if count.isdigit() and words.kind.endswith("numbers"):
        return value_text([float(k) for k in range(int(count))])
    made = {"list of names": '["name"]', "list of numbers": "[0.0]", "columns": '["column"]'}
    return made.get(words.kind, "{}" if words.kind.startswith("table") else '""')


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
