"""What sets a fault right, as data: edits of an experiment file that a program can apply.

A check that measures a delay knows its number, one that finds two columns exchanged knows which.
Both say it as edits, which `pivident.experiment.repairs` turns into keys and values of a file.
Places begin with ``recording`` for the recording that the finding is about, until its table is
known:

    Repair((Edit(("recording", "delay"), 0.0103),))
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, fields, replace
from typing import Any, ClassVar, Self

from pivident.foundation.text.plain_values import lists_as_tuples

#: Tables, keys and numbers of elements, such as ``("recording", 0, "units", "q")``.
Place = tuple[int | str, ...]

#: Table of the recording that a finding is about, before its number is known.
RECORDING: Place = ("recording",)


def placed(place: Place, table: Place) -> Place:
    """A place of the recording that a finding is about, as one of its table in the file."""
    is_open = place[:1] == RECORDING and not (len(place) > 1 and isinstance(place[1], int))
    return (*table, *place[1:]) if is_open and table else place


#: What a channel is called in a sentence.
CALLED = {"tau": "torque", "q_ref": "reference", "q": "position"}


@dataclass(frozen=True)
class Change:
    """One edit.

    Attributes:
        each: name of the field that has an entry for each joint; edits that differ in nothing else
            are one edit. Empty where there is no such field.
    """

    each: ClassVar[str] = ""

    def below(self, table: Place) -> Self:
        """The same edit, of the recording in this table."""
        return self

    def joined(self, other: Change) -> Self | None:
        """Both edits as one, where they differ in their joints only; else None."""
        if self == other:
            return self
        if not self.each or type(self) is not type(other):
            return None
        entries = getattr(other, self.each)
        if replace(self, **{self.each: entries}) != other:
            return None
        mine = getattr(self, self.each)
        return replace(self, **{self.each: (*mine, *(e for e in entries if e not in mine))})


@dataclass(frozen=True)
class OfKey(Change):
    """An edit of one key.

    Attributes:
        place: tables and key.
    """

    place: Place

    def below(self, table: Place) -> Self:
        """The same edit, of the recording in this table."""
        return replace(self, place=placed(self.place, table))


@dataclass(frozen=True)
class Edit(OfKey):
    """A value of a key.

    Attributes:
        value: a plain value; None: the key is removed.
    """

    value: Any = None


@dataclass(frozen=True)
class Renamed(OfKey):
    """A key that is called otherwise.

    Attributes:
        name: what it is called.
    """

    name: str


@dataclass(frozen=True)
class Respelt(OfKey):
    """A name among the values of a key that is written otherwise.

    Attributes:
        wrong: as it stands there.
        right: as it is written.
    """

    wrong: str
    right: str


@dataclass(frozen=True)
class Scaled(OfKey):
    """Numbers of single joints, multiplied, of a key that has one for all of them or a list.

    Attributes:
        factors: joints and what their numbers are multiplied by.
    """

    each: ClassVar[str] = "factors"
    factors: tuple[tuple[str, float], ...]


@dataclass(frozen=True)
class OfLog(Change):
    """An edit about channels of a log.

    Attributes:
        table: of its recording.
    """

    table: Place = RECORDING

    def below(self, table: Place) -> Self:
        """The same edit, of the recording in this table."""
        return replace(self, table=placed(self.table, table))


@dataclass(frozen=True, kw_only=True)
class Reversed(OfLog):
    """A channel of single joints, with the other sign.

    Attributes:
        channel: such as ``tau``; empty: every channel that is read, so that the joint turns the
            other way.
        joints: names.
    """

    each: ClassVar[str] = "joints"
    channel: str
    joints: tuple[str, ...]


@dataclass(frozen=True, kw_only=True)
class Multiplied(OfLog):
    """A channel of single joints in another unit.

    Attributes:
        channel: such as ``tau``.
        factors: joints and what their values are multiplied by.
    """

    each: ClassVar[str] = "factors"
    channel: str
    factors: tuple[tuple[str, float], ...]


@dataclass(frozen=True, kw_only=True)
class Retimed(OfLog):
    """A clock that runs too fast or too slowly.

    Attributes:
        factor: what the times of the log are multiplied by.
    """

    factor: float


@dataclass(frozen=True, kw_only=True)
class Reordered(OfLog):
    """Columns of a channel, dealt out to the joints in another way.

    Attributes:
        channel: such as ``tau``; empty: every channel that is read.
        order: number of the column that belongs to each joint.
    """

    channel: str
    order: tuple[int, ...]


@dataclass(frozen=True, kw_only=True)
class Shifted(OfLog):
    """Zeros of single joints, moved.

    Attributes:
        offsets: joints and what is added to their positions [rad or m].
    """

    each: ClassVar[str] = "offsets"
    offsets: tuple[tuple[str, float], ...]


@dataclass(frozen=True, kw_only=True)
class Gain(OfLog):
    """Drive gains of single joints whose torque is a command.

    Attributes:
        gains: joints and N m (or N) per unit of their commands.
    """

    each: ClassVar[str] = "gains"
    gains: tuple[tuple[str, float], ...]


@dataclass(frozen=True, kw_only=True)
class NotRead(OfLog):
    """A channel whose columns are not read.

    Attributes:
        channel: such as ``dq``.
    """

    channel: str


@dataclass(frozen=True, kw_only=True)
class LeftOut(OfLog):
    """Joints that are frozen, and whose columns are not read.

    Attributes:
        at: joints and the positions at which they stand [rad or m].
    """

    each: ClassVar[str] = "at"
    at: tuple[tuple[str, float], ...]


@dataclass(frozen=True)
class Repair:
    """One way to set a fault right.

    Attributes:
        edits: what is changed, in this order.
        words: what is done, a sentence; empty: it follows from the edits.
    """

    edits: tuple[Change, ...]
    words: str = ""

    def below(self, table: Place) -> Repair:
        """The same repair, of the recording in this table."""
        return replace(self, edits=tuple(edit.below(table) for edit in self.edits))

    def joined(self, other: Repair) -> Repair | None:
        """Both as one repair, where they differ in their joints only; else None."""
        if len(self.edits) != len(other.edits):
            return None
        edits = [a.joined(b) for a, b in zip(self.edits, other.edits, strict=True)]
        whole = tuple(edit for edit in edits if edit is not None)
        return replace(self, edits=whole) if len(whole) == len(edits) else None

    def as_json(self) -> dict[str, Any]:
        """Plain values."""
        edits = [{"edit": type(edit).__name__, **asdict(edit)} for edit in self.edits]
        return {"words": self.words, "edits": edits}

    @classmethod
    def of_json(cls, content: Mapping[str, Any]) -> Repair:
        """The repair of `as_json`, also after it was a file.

        Raises:
            ValueError: it has another form.
        """
        try:
            return cls(tuple(_edit_of(edit) for edit in content["edits"]), str(content["words"]))
        except (KeyError, TypeError, AttributeError):
            raise ValueError("this is no repair") from None


#: Edits by name.
CHANGES = {
    kind.__name__: kind
    for kind in (
        Edit, Renamed, Respelt, Scaled, Reversed, Multiplied, Retimed, Reordered, Shifted, Gain,
        NotRead, LeftOut,
    )
}  # fmt: skip


def setting(*place: int | str, value: Any = None, words: str = "") -> Repair:
    """The repair that sets one key of the recording that a finding is about, or removes it."""
    return Repair((Edit((*RECORDING, *place), value),), words)


def in_unit(channel: str, unit: str) -> Repair:
    """Another unit of a channel."""
    words = f'Change the unit: units = {{{channel} = "{unit}"}}.'
    return setting("units", channel, value=unit, words=words)


def joined_repairs(several: Sequence[Sequence[Repair]]) -> Iterator[Repair]:
    """Repairs of findings that differ in their joints only, each as one for all of them."""
    first, *others = several
    for k, repair in enumerate(first):
        joined: Repair | None = repair
        for repairs in others:
            joined = joined.joined(repairs[k]) if joined and k < len(repairs) else None
        yield joined or repair


def _edit_of(content: Mapping[str, Any]) -> Change:
    """An edit of its plain values: lists are tuples again but in values of the file."""
    kind = CHANGES[content["edit"]]
    if content.keys() - {"edit", *[field.name for field in fields(kind)]}:
        raise TypeError
    return kind(
        **{n: x if n == "value" else lists_as_tuples(x) for n, x in content.items() if n != "edit"}
    )
