"""The lines of an experiment file as rows of a table, each with its reason and its meaning."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from tomlkit.items import InlineTable, Item

from pivident.experiment.edited_lines import document_of, table_name
from pivident.experiment.file_lines import file_lines, sureness
from pivident.studio.key_words import (
    KeyWords,
    example_of,
    keys_of_table,
    words_of_key,
    written_out,
)
from pivident.text.repair import Place
from pivident.text.toml_tree import keys_in

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
