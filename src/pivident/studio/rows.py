"""The lines of an experiment file as rows of a table, each with its reason and its meaning."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from pivident.errors import ExperimentError
from pivident.studio.comments import comments, sureness
from pivident.studio.key_words import (
    KeyWords,
    example_of,
    keys_of_table,
    numbered,
    words_of_key,
    written_out,
)
from pivident.text.toml import parse_toml
from pivident.text.toml_places import Place, TomlItem, toml_items

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
    items = checked_items(text)
    above = {comment.place: comment for comment in comments(text)}
    rows: list[tuple[int, Row]] = []
    reason, inside = "", Place()
    for item in items:
        if item.kind != "key" or (inside and item.inline and item.place[: len(inside)] == inside):
            continue  # a table of it has its row
        value = text[item.value : item.stop]
        place = written_out(item.place, value)
        words = words_of_key(place)
        reason = above[item.place].text if item.place in above else reason
        if value.startswith("{") and words is not None and words.is_table:
            continue
        inside = item.place
        rows.append((item.start, _row(place, value, "", reason, words)))
    present = {row.place for _, row in rows}
    for comment in above.values():
        place = numbered(comment.place)
        if comment.example is None or place in present:
            continue
        words = words_of_key(place)
        if words is not None:
            rows.append((comment.start, _row(place, None, comment.example, comment.text, words)))
    return tuple(row for _, row in sorted(rows, key=lambda pair: pair[0]))


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


def checked_items(text: str) -> list[TomlItem]:
    """What stands in a text.

    Raises:
        ExperimentError: it is not TOML.
    """
    try:
        parse_toml(text)
    except ValueError as error:
        raise ExperimentError(f"is not TOML: {error}", advice="correct this line") from error
    return toml_items(text)


def table_name(place: Sequence[int | str]) -> str:
    """Tables of a place without their numbers."""
    return ".".join(str(part) for part in place[:-1] if isinstance(part, str))


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
