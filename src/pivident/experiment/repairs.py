"""Repairs of findings as keys and values of an experiment file.

A repair says what is wrong with a log: this torque is reversed, those two columns are exchanged.
What that is in a file depends on what the file says already: a sign is a factor of a unit, which
may be one for all joints, one for each, or the gain of a command. A repair that contradicts the
file is refused.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import singledispatch
from typing import Any

from pivident.data.logs.units import COMMAND, TIME, UNITS_OF
from pivident.foundation.errors import ExperimentError
from pivident.foundation.text.repair import (
    CALLED,
    Change,
    Edit,
    Gain,
    LeftOut,
    Multiplied,
    NotRead,
    Place,
    Renamed,
    Reordered,
    Repair,
    Respelt,
    Retimed,
    Reversed,
    Scaled,
    Shifted,
)
from pivident.foundation.text.toml import value_text
from pivident.robot.naming import URDF_FILES

#: Channels of a joint that count the way in which it turns.
COUNTED = ("q", "tau", "q_ref", "dq_ref", "ddq_ref", "dq")


@dataclass(frozen=True)
class FileEdits:
    """A repair as edits of one file.

    Attributes:
        words: what is done, a sentence.
        edits: places and new plain values, in their order; None: removed.
    """

    words: str
    edits: tuple[tuple[Place, Any], ...]


@dataclass(frozen=True)
class FileContent:
    """What a file says.

    Attributes:
        content: the file, its short forms written out.
        joints: names of the robot's joints, in order; empty where they are not known.
    """

    content: Mapping[str, Any]
    joints: tuple[str, ...]

    def value(self, *place: int | str) -> Any:
        """What the file says at a place; None for nothing."""
        value: Any = self.content
        for part in place:
            try:
                value = value[part]
            except (KeyError, IndexError, TypeError):
                return None
        return value

    def number_of(self, joint: str) -> int:
        """Number of a joint.

        Raises:
            ExperimentError: the robot has no such joint.
        """
        if joint not in self.joints:
            raise _contradiction(f"the robot of this file has no joint {joint!r}")
        return self.joints.index(joint)

    def columns(self, table: Place, channel: str) -> list[str]:
        """Columns of a channel, one for each joint.

        Raises:
            ExperimentError: they are not listed by name.
        """
        listed = self.value(*table, "columns", channel)
        if not (isinstance(listed, list) and all(isinstance(name, str) for name in listed)):
            raise _contradiction(f"the columns of {channel} are not listed by name")
        return list(listed)

    def units(self, table: Place, channel: str) -> list[Any]:
        """Unit of a channel for each joint; None where nothing is said."""
        said = self.value(*table, "units", channel)
        listed = list(said) if isinstance(said, list) else [said] * len(self.joints)
        return [*listed, *[None] * len(self.joints)][: len(self.joints)]

    def numbers(self, place: Place, otherwise: float | None = None) -> list[float]:
        """Numbers of all joints, which may be one for all.

        Raises:
            ExperimentError: there are none, or not as many as joints.
        """
        said: Any = self.value(*place)
        said = otherwise if said is None else said
        listed = list(said) if isinstance(said, list) else [said] * len(self.joints)
        is_number = all(isinstance(x, (int, float)) and not isinstance(x, bool) for x in listed)
        if not listed or not is_number or len(listed) != len(self.joints):
            raise _contradiction(f"{_called(place)} has no number for each joint")
        return [float(x) for x in listed]


def edits_of(repair: Repair, file: FileContent) -> FileEdits:
    """A repair as edits of a file.

    Args:
        repair: of the recording in its table (`Repair.below`).
        file: what the file says.

    Raises:
        ExperimentError: it contradicts the file; the message says what, and what to do.
    """
    words: list[str] = []
    edits: list[tuple[Place, Any]] = []
    for change in repair.edits:
        made = _resolved(change, file)
        words.append(made.words)
        edits += made.edits
    return FileEdits(repair.words or " ".join(words), tuple(edits))


@singledispatch
def _resolved(edit: Change, file: FileContent) -> FileEdits:
    """A single edit, of which each kind has its function below."""
    raise TypeError(f"no edit of a file: {type(edit).__name__}")


@_resolved.register
def _edit(edit: Edit, file: FileContent) -> FileEdits:
    """A value as it is; of a side that is said of all channels, that of one of them."""
    *above, key = edit.place
    if edit.value is None:
        if file.value(*edit.place) is None:
            raise _contradiction(f"{_called(edit.place)} is not in the file")
        what = "this run" if isinstance(key, int) else str(key)
        return FileEdits(f"Remove {what}.", ((edit.place, None),))
    words = f"Write {key} = {value_text(edit.value)}."
    if above[-1:] == ["side"] and not isinstance(file.value(*above), dict):
        said = file.value(*above) or "joint"
        whole = {"q": said, "tau": said} | {str(key): edit.value}
        return FileEdits(words, ((tuple(above), whole),))
    return FileEdits(words, ((edit.place, edit.value),))


@_resolved.register
def _renamed(edit: Renamed, file: FileContent) -> FileEdits:
    """A key that is taken away and written under another name."""
    value, place = file.value(*edit.place), (*edit.place[:-1], edit.name)
    if value is None or isinstance(value, dict):
        raise _contradiction(f"{_called(edit.place)} is no key with a value")
    if file.value(*place) is not None:
        raise _contradiction(f"{_called(place)} is there as well")
    return FileEdits(f"Call it {edit.name}.", ((edit.place, None), (place, value)))


@_resolved.register
def _respelt(edit: Respelt, file: FileContent) -> FileEdits:
    """A name among the values of a key."""
    wrong, right, value = edit.wrong, edit.right, file.value(*edit.place)
    words = f"Write {right}."
    if isinstance(value, list) and wrong in value:
        return FileEdits(words, ((edit.place, [right if x == wrong else x for x in value]),))
    if value != wrong:
        raise _contradiction(f"{_called(edit.place)} does not name {wrong!r}")
    return FileEdits(words, ((edit.place, right),))


@_resolved.register
def _scaled(edit: Scaled, file: FileContent) -> FileEdits:
    """Numbers by joint, four digits of those that change."""
    numbers, changed = file.numbers(edit.place), []
    for joint, factor in edit.factors:
        j = file.number_of(joint)
        numbers[j] = float(f"{numbers[j] * factor:.4g}")
        changed.append(f"{edit.place[-1]} = {numbers[j]:g} for {joint}")
    words = f"Take {', '.join(changed)}, as the log shows."
    return FileEdits(words, ((edit.place, numbers),))


@_resolved.register
def _reversed(edit: Reversed, file: FileContent) -> FileEdits:
    """Factors with the other sign, for one channel or all that are read."""
    factors, names = {file.number_of(name): -1.0 for name in edit.joints}, ", ".join(edit.joints)
    if edit.channel:
        words = f"Reverse the sign of the {_named(edit.channel)} of {names}."
        return FileEdits(words, (_times(edit.table, edit.channel, factors, file),))
    words = f"Reverse the signs of all channels of {names}."
    read = _read(edit.table, COUNTED, file)
    return FileEdits(words, tuple(_times(edit.table, c, factors, file) for c in read))


@_resolved.register
def _multiplied(edit: Multiplied, file: FileContent) -> FileEdits:
    """Factors to SI that are so many times the present ones."""
    factors = {file.number_of(joint): factor for joint, factor in edit.factors}
    said = ", ".join(f"{factor:.4g} for {joint}" for joint, factor in edit.factors)
    words = f"Multiply the {_named(edit.channel)} by {said}."
    return FileEdits(words, (_times(edit.table, edit.channel, factors, file),))


def _named(channel: str) -> str:
    """A channel in words."""
    return CALLED.get(channel, channel)


def _read(table: Place, channels: Sequence[str], file: FileContent) -> list[str]:
    """Those of some channels that the file names columns for."""
    return [c for c in channels if file.value(*table, "columns", c) is not None]


def _times(
    table: Place, channel: str, factors: Mapping[int, float], file: FileContent
) -> tuple[Place, Any]:
    """Units of a channel with factors for some joints; SI where nothing was said."""
    units = [
        _unit_times(channel, unit, factors[j]) if j in factors else 1.0 if unit is None else unit
        for j, unit in enumerate(file.units(table, channel))
    ]
    return (*table, "units", channel), _one_for_all(units)


def _unit_times(channel: str, unit: Any, factor: float) -> Any:
    """So many times a unit, as a factor to SI, or in the gain of a command; six digits."""
    if isinstance(unit, dict) and "gain" in unit:
        return unit | {"gain": float(f"{factor * unit['gain']:.6g}")}
    is_command = isinstance(unit, str) and unit in COMMAND
    known = UNITS_OF[channel].get(unit) if isinstance(unit, str) else unit
    if isinstance(unit, dict) or is_command or (unit is not None and known is None):
        raise _contradiction(
            f"the unit {unit!r} of {channel} has no sign or size of its own",
            "change the gain of the drive, drive_gain under [robot]",
        )
    return float(f"{factor * (1.0 if known is None else known):.6g}")


@_resolved.register
def _retimed(edit: Retimed, file: FileContent) -> FileEdits:
    """Another unit of the stamps, with the times that are on them; or another rate."""
    if file.value(*edit.table, "columns", "t") is not None:
        unit = file.value(*edit.table, "units", "t")
        seconds = TIME.get(unit, 1.0) if isinstance(unit, str) else float(unit or 1.0)
        worth = float(f"{edit.factor * seconds:.6g}")
        words = f"Take {worth:g} s for a unit of the stamps."
        times = [
            ((*edit.table, key), _stretched(file.value(*edit.table, key), edit.factor))
            for key in ("part", "delay")
            if file.value(*edit.table, key) is not None
        ]
        return FileEdits(words, (((*edit.table, "units", "t"), worth), *times))
    place = (*edit.table, "rate")
    rate = file.value(*place)
    if not isinstance(rate, (int, float)):
        raise _contradiction("the file has neither stamps nor a rate")
    rate = float(f"{rate / edit.factor:.6g}")
    return FileEdits(f"Take {rate:g} Hz for the rate.", ((place, rate),))


def _stretched(time: Any, factor: float) -> Any:
    """A time or an interval times a factor."""
    if isinstance(time, list):
        return [_stretched(x, factor) for x in time]
    return float(f"{factor * time:.9g}")


@_resolved.register
def _reordered(edit: Reordered, file: FileContent) -> FileEdits:
    """The same columns, each with the joint that it belongs to."""
    edits: list[tuple[Place, Any]] = []
    channels = [edit.channel] if edit.channel else _read(edit.table, COUNTED, file)
    for channel in channels:
        names = file.columns(edit.table, channel)
        if sorted(edit.order) != list(range(len(names))):
            raise _contradiction(f"{channel} has {len(names)} columns, not {len(edit.order)}")
        edits.append(((*edit.table, "columns", channel), [names[k] for k in edit.order]))
    said = " and ".join(f"of {place[-1]} as {', '.join(right)}" for place, right in edits)
    return FileEdits(f"Name the columns {said}.", tuple(edits))


@_resolved.register
def _shifted(edit: Shifted, file: FileContent) -> FileEdits:
    """Offsets on top of those that the file states."""
    place = (*edit.table, "position_offset")
    offsets, said = file.numbers(place, otherwise=0.0), []
    for joint, offset in edit.offsets:
        j = file.number_of(joint)
        offsets[j] = round(offsets[j] + offset, 4)
        said.append(f"{joint} by {offset:.4f} rad")
    return FileEdits(f"Move the zero of {', '.join(said)}.", ((place, offsets),))


@_resolved.register
def _gain(edit: Gain, file: FileContent) -> FileEdits:
    """Gains beside the units of commands."""
    units, said = file.units(edit.table, "tau"), []
    for joint, gain in edit.gains:
        j = file.number_of(joint)
        name = units[j].get("unit") if isinstance(units[j], dict) else units[j]
        if name not in COMMAND:
            raise _contradiction(f"the torque of {joint} is no command")
        units[j] = {"unit": name, "gain": gain}
        said.append(f"{gain:.4g} per {name} for {joint}")
    words = f"Take {', '.join(said)}, as the masses suggest."
    return FileEdits(words, (((*edit.table, "units", "tau"), _one_for_all(units)),))


@_resolved.register
def _not_read(edit: NotRead, file: FileContent) -> FileEdits:
    """Neither the columns nor the unit of a channel."""
    places = [(*edit.table, table, edit.channel) for table in ("columns", "units")]
    said = [place for place in places if file.value(*place) is not None]
    if places[0] not in said:
        raise _contradiction(f"{edit.channel} has no columns in the file")
    words = f"Do not read {edit.channel}: the derivative of the position takes its place."
    return FileEdits(words, tuple((place, None) for place in said))


@_resolved.register
def _left_out(edit: LeftOut, file: FileContent) -> FileEdits:
    """Joints of a URDF that are frozen, without their columns."""
    if not str(file.value("robot", "model") or "").endswith(URDF_FILES):
        raise _contradiction("only joints of a URDF can be frozen")
    still = {file.number_of(joint): at for joint, at in edit.at}
    kept = [j for j in range(len(file.joints)) if j not in still]
    if not kept:
        raise _contradiction("no joint would be left")
    edits: list[tuple[Place, Any]] = [(("robot", "joints"), [file.joints[j] for j in kept])]
    edits += [(("robot", "frozen", file.joints[j]), at) for j, at in sorted(still.items())]
    edits += [
        ((*edit.table, table, channel), [listed[j] for j in kept])
        for table in ("columns", "units")
        for channel, listed in (file.value(*edit.table, table) or {}).items()
        if isinstance(listed, list) and len(listed) == len(file.joints)
    ]
    names = ", ".join(joint for joint, _ in edit.at)
    words = f"Leave {names} out: frozen, and its columns are not read."
    return FileEdits(words, tuple(edits))


def _one_for_all(units: list[Any]) -> Any:
    """One unit where all joints have the same."""
    return units[0] if all(unit == units[0] for unit in units) else units


def _called(place: Place) -> str:
    """Table and key of a place."""
    names = [str(part) for part in place if isinstance(part, str)]
    return f"[{names[0]}] {'.'.join(names[1:])}".strip()


def _contradiction(fact: str, step: str = "check the experiment again") -> ExperimentError:
    """That a repair does not fit the file."""
    return ExperimentError(f"{fact}", advice=step)
