"""A file of a log as columns: which channel and which joint each is; the files of one run.

Which series of columns is which channel, and which joint each column belongs to.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from pivident.data.logs.bags.bag_table import OwnClock, bag_table
from pivident.data.logs.bags.read_bag import is_bag
from pivident.data.logs.file_columns import file_columns
from pivident.data.logs.recognition.channel_words import (
    OTHER_TEMPERATURE,
    TEMPERATURE,
    Reading,
    Sureness,
    read_words,
    words_of,
)
from pivident.data.logs.recognition.log_clock import JOINT, Series, column_series, is_clock
from pivident.data.logs.recognition.presets import Preset, recognised, with_meanings
from pivident.data.logs.source_files import printable_name
from pivident.data.logs.tables.tables import endings, named_columns

#: What is looked for: channels, and the quantities that can stand for each.
CHANNELS = {
    "q": ("q",), "tau": ("tau", "current"), "dq": ("dq",),
    "q_ref": ("q_ref",), "dq_ref": ("dq_ref",), "ddq_ref": ("ddq_ref",),
}  # fmt: skip


@dataclass(frozen=True, eq=False)
class LogFile:
    """One file."""

    path: Path  # where it is
    columns: dict[str, np.ndarray]  # numeric, shape (samples,), in the units of the file
    series: tuple[Series, ...]  # columns that belong together
    # clocks of the columns that have one of their own, by name; these columns are taken at the
    # instants of the others, NaN where they say nothing
    own_clocks: Mapping[str, OwnClock] = field(default_factory=dict)
    joint_names: tuple[str, ...] = ()  # of the robot, or as the messages of a bag call them
    aside: tuple[str, ...] = ()  # other topics of a bag with positions
    titles: Mapping[str, str] = field(default_factory=dict)  # given to columns without a header
    constants: Mapping[str, np.ndarray] = field(default_factory=dict)  # gains, ratios, by name
    beside: Mapping[str, str] = field(default_factory=dict)  # why all else is no column, by name
    preset: Preset | None = None  # the kind of log that its names are those of

    @property
    def samples(self) -> int:
        """Number of rows."""
        return len(next(iter(self.columns.values())))

    def title(self, column: str) -> str:
        """What somebody calls a column, else its own name."""
        return self.titles.get(column, column)

    @property
    def shown(self) -> str:
        """Its name as it can be printed."""
        return printable_name(self.path)


@dataclass(frozen=True, eq=False)
class Run:
    """One run of the robot: its files side by side."""

    files: tuple[LogFile, ...]


def read_log_file(
    path: Path,
    joint_names: Sequence[str] = (),
    column_names: Sequence[str] = (),
    *,
    one_of_several: bool = False,
) -> LogFile:
    """The columns of a file, of a bag those of its arm; see `log_file` for the next step.

    ``column_names``: of a table without a header. They become those of its columns, unless it is
    ``one_of_several`` files, of which an experiment file takes the columns by number.
    """
    if is_bag(path):
        arm = bag_table(path, tuple(joint_names))
        preset = recognised(arm.columns, arm.joint_names)
        series = column_series(list(arm.columns), arm.joint_names)
        if preset is not None:
            series = with_meanings(preset, series)
        return LogFile(
            path, arm.columns, tuple(series), arm.own_clocks, arm.joint_names, arm.aside,
            beside=arm.beside, preset=preset,
        )  # fmt: skip
    held = file_columns(path)
    columns, titles = held.columns, {}
    if column_names:
        named = named_columns(path, column_names)
        if one_of_several:
            titles = {own: name for name, own in named.items()}
        else:
            columns = {name: columns[own] for name, own in named.items() if own in columns}
    names = {titles.get(n, n): n for n, values in columns.items()}
    names = {title: n for title, n in names.items() if not is_clock(title, columns[n])}
    own, preset = file_reading(path), recognised(names, joint_names)
    read, series = column_series(list(names), joint_names), []
    for found in read if preset is None else with_meanings(preset, read):
        bare = found.channel is None and not found.reading.foreign and JOINT in found.words
        if bare and own.channel is not None:
            # Only the file's name says what columns called after joints hold.
            found = replace(found, reading=replace(own, unit=found.reading.unit))
        series.append(replace(found, columns={k: names[n] for k, n in found.columns.items()}))
    return LogFile(
        path, columns, tuple(series), joint_names=tuple(joint_names), titles=titles,
        constants=held.constants, beside=held.beside, preset=preset,
    )  # fmt: skip


def file_reading(path: Path) -> Reading:
    """What the name of a file says about its columns: ``arm_effort.csv``."""
    name = path.name
    for ending in (".gz", *endings()):
        name = name.removesuffix(ending)
    return read_words([word for word in words_of(name) if len(word) > 2 or word in ("q", "dq")])


@dataclass(frozen=True, eq=False)
class ChannelColumns:
    """One channel as the log has it."""

    name: str  # ``q``, ``tau`` …
    file: int  # number of its file in the run
    columns: Mapping[str, str]  # column of each joint of the robot that it has, by the joint's name
    units: Mapping[str, str]  # units written in the names, by the joint's name
    is_current: bool  # whether the name is that of a current
    contested: bool = False  # whether another series could have been meant just as well
    others: tuple[str, ...] = ()  # first columns of further such series

    def values(self, run: Run, joints: Sequence[str]) -> np.ndarray:
        """Numbers of some joints as logged, shape (samples, joints)."""
        table = run.files[self.file].columns
        return np.column_stack([table[self.columns[joint]] for joint in joints])

    def own_clock(self, run: Run) -> OwnClock | None:
        """The clock of a channel that was logged beside the positions, by a clock of its own."""
        clocks = run.files[self.file].own_clocks
        return next((clocks[c] for c in self.columns.values() if c in clocks), None)


def temperature_columns(run: Run, q: ChannelColumns) -> ChannelColumns | None:
    """Temperatures of the motors by joint: a column for each position, or one for all joints.

    They must vary, and are looked for in the file of the positions.
    """
    file = run.files[q.file]
    for series in file.series:
        words = set(series.words)
        own = series.channel == "temperature" or words & TEMPERATURE
        if not own or words & OTHER_TEMPERATURE or series.reading.channel not in (
            None, "temperature"
        ):  # fmt: skip
            continue
        values = np.column_stack([file.columns[name] for name in series.columns.values()])
        if not np.isfinite(values).all() or not np.ptp(values, axis=0).any():
            continue
        columns: dict[str, str] = {}
        if set(q.columns) <= set(series.columns):
            columns = {joint: series.columns[joint] for joint in q.columns}
        elif len(series.columns) == len(q.columns) and all(map(str.isdecimal, series.columns)):
            ordered = [series.columns[key] for key in _in_order(series.columns)]
            columns = dict(zip(q.columns, ordered, strict=True))
        elif len(series.columns) == 1:
            columns = dict.fromkeys(q.columns, next(iter(series.columns.values())))
        if columns:
            return ChannelColumns("temperature", q.file, columns, {}, False)
    return None


@dataclass(frozen=True, eq=False)
class JointMap:
    """Which columns belong to which joint."""

    channels: dict[str, ChannelColumns]  # with a column for some or all joints of ``q``
    sure: Sureness  # how sure the map from columns to joints is
    seen: str  # what it follows from


def joint_map(run: Run, joint_names: Sequence[str] = ()) -> JointMap:
    """Choose the series of every channel and give their columns to the joints.

    Without names of the robot's joints, joints are called after the numbers of the columns.
    """
    listed = [(k, s) for k, file in enumerate(run.files) for s in file.series]
    torques = [s.reading.strange for _, s in listed if s.channel in ("tau", "current")]
    positions = _ranked(listed, run, ("q",), torques) or _bare_positions(listed)
    if not positions:
        return JointMap({}, "assumed", "no column seems to hold positions of joints")
    first = positions[0][1]
    worded: list[str] = []
    misfit = len(first.columns) != len(joint_names)
    if not joint_names:  # words of one's own for joints that somebody else has named
        misfit = not torques or len(first.columns) == 1
    if misfit and not first.named and not is_bag(run.files[0].path):
        found, labels = _worded(listed, joint_names)
        driven = {s.channel for _, s in found} & {"tau", "current"}
        if len(labels) > len(first.columns) and (joint_names or driven or not torques):
            listed, worded = found, labels
            positions = _ranked(listed, run, ("q",), torques)
            first = positions[0][1]
    keys = list(first.columns)
    if not joint_names:
        joint_names = keys if first.named else [f"joint_{k or 1}" for k in _in_order(keys)]
    joints, sure, seen = _joints_of(first, joint_names)
    if worded:
        called = ", ".join(label or "no number" for label in worded)
        sure, seen = "assumed", f"columns of {called}, taken for the joints in order"
    doubtful = sure == "assumed" and not first.named  # more columns than joints
    if first.channel is None and (first.reading.strange or not torques):
        doubtful = True  # numbered columns of any name may hold anything
    channels = {}
    for name, kinds in CHANNELS.items():
        alike = torques if name == "q" else [first.reading.strange]
        ranked = positions if name == "q" else _ranked(listed, run, kinds, alike)
        if ranked:
            merits = [_merit(entry, run, kinds, alike) for entry in ranked]
            contested = name == "q" and doubtful
            for (_, series), (alive, *words) in zip(ranked, merits, strict=True):
                another = series.reading.strange != ranked[0][1].reading.strange
                # That more of its columns change makes no arm the one that was meant.
                contested |= another and [merits[0][0] > 0, *merits[0][1:]] == [alive > 0, *words]
            channels[name] = _channel(name, ranked, joints, keys, joint_names, contested)
    return JointMap(channels, sure, seen)


def _worded(
    listed: Sequence[tuple[int, Series]], joint_names: Sequence[str]
) -> tuple[list[tuple[int, Series]], list[str]]:
    """Series of columns that call joints by words of their own, ``q_hip`` and ``q_knee``."""
    groups: dict[tuple[int, Reading], dict[str, str]] = {}
    for file, series in listed:
        reading = replace(series.reading, strange=(), measured=max(0, series.reading.measured))
        for key, column in series.columns.items():
            label = "_".join((*series.reading.strange, *([key] if key else [])))
            groups.setdefault((file, reading), {}).setdefault(label, column)
    sets = [list(own) for (_, reading), own in groups.items() if reading.channel == "q"]
    labels = max(sets, key=len, default=[])
    names = joint_names or [f"joint_{label}" for label in labels]
    if len(labels) < 2 or len(names) != len(labels):
        return list(listed), []
    found = [
        (file, Series((), {n: own[k] for n, k in zip(names, labels, strict=True)}, True, reading))
        for (file, reading), own in groups.items()
        if set(labels) <= set(own)
    ]
    return found, labels


def _merit(
    entry: tuple[int, Series], run: Run, kinds: Sequence[str], alike: Sequence[tuple[str, ...]]
) -> tuple[int, ...]:
    """How likely a series is the one: columns that change, and what its words say."""
    file, series = entry
    alive = 0
    for column in series.columns.values():
        values = run.files[file].columns[column]
        finite = values[np.isfinite(values)]
        alive += bool(finite.size and finite.min() < finite.max())
    return (
        alive,
        series.reading.measured,
        series.named,
        -kinds.index(series.channel) if series.channel in kinds else 0,
        series.reading.strange in alike,  # of the same arm as the torques or the positions
        len(series.columns),
    )


def _ranked(
    listed: Sequence[tuple[int, Series]],
    run: Run,
    kinds: Sequence[str],
    alike: Sequence[tuple[str, ...]],
) -> list[tuple[int, Series]]:
    """Series of one quantity, the most likely one first."""
    own = [entry for entry in listed if entry[1].channel in kinds]
    return sorted(own, key=lambda entry: _merit(entry, run, kinds, alike), reverse=True)


def _bare_positions(listed: Sequence[tuple[int, Series]]) -> list[tuple[int, Series]]:
    """Columns named after axes alone: ``A1``, ``J2``, ``joint_3``."""
    return [
        (k, s)
        for k, s in listed
        if s.channel is None and not s.reading.foreign and JOINT in s.words
    ][:1]


def _in_order(keys: Iterable[str]) -> list[str]:
    """The numbers of columns in their order."""
    return sorted(keys, key=lambda key: int(key or 0))


def _joints_of(series: Series, joint_names: Sequence[str]) -> tuple[dict[str, str], Sureness, str]:
    """The robot's joint for each key of a series."""
    keys = list(series.columns)
    if series.named:
        return {k: k for k in keys}, "certain", "the columns carry names of the robot's joints"
    if keys == [""]:
        only = len(joint_names) == 1
        seen = "one position and no number: the " + ("only" if only else "first") + " joint"
        return {"": joint_names[0]}, "likely" if only else "assumed", seen
    numbers = _in_order(keys)
    by_number = _by_number(joint_names)
    if len(numbers) == len(joint_names):
        named = next((own for _, own in by_number if len(own) == len(joint_names)), None)
        if named is not None and named != list(joint_names):
            pairs = dict(zip(numbers, named, strict=True))
            seen = f"{len(numbers)} numbered columns, as {named[0]} … {named[-1]}"
            return pairs, "likely", seen
        pairs = dict(zip(numbers, joint_names, strict=True))
        seen = f"{len(numbers)} numbered columns for {len(joint_names)} joints, from the base on"
        return pairs, "likely", seen
    for start, numbered in by_number:
        own = {str(int(k)): k for k in numbers}
        called = [str(start + k) for k in range(len(numbered))]
        if len(numbered) == len(joint_names) and own.keys() > set(called):
            pairs = {own[k]: name for k, name in zip(called, numbered, strict=True)}
            return pairs, "likely", f"columns {', '.join(called)}, the numbers of the joints' names"
        if len(numbered) == len(numbers) and int(numbers[0]) in (0, start):
            pairs = dict(zip(numbers, numbered, strict=True))
            seen = f"{len(numbers)} numbered columns, as {numbered[0]} … {numbered[-1]}"
            return pairs, "likely", seen
        if (
            start == 1
            and int(numbers[0]) >= 1
            and set(own) <= {str(k + 1) for k in range(len(numbered))}
        ):
            pairs = {own[k]: numbered[int(k) - 1] for k in own}
            return (
                pairs,
                "assumed",
                f"numbers {', '.join(numbers)} taken as those of the joints' names",
            )
    if len(numbers) < len(joint_names):
        pairs = dict(zip(numbers, joint_names, strict=False))
        seen = (
            f"{len(numbers)} numbered columns for {len(joint_names)} joints: taken for the first "
            "ones from the base on"
        )
        return pairs, "assumed", seen
    pairs = dict(zip(numbers, joint_names, strict=False))
    seen = (
        f"{len(numbers)} numbered columns for {len(joint_names)} joints: the first "
        f"{len(joint_names)} are taken"
    )
    return pairs, "assumed", seen


def _by_number(joint_names: Sequence[str]) -> list[tuple[int, list[str]]]:
    """Families of joints that differ in one number, with the first number; the largest first."""
    families: dict[str, list[tuple[int, str]]] = {}
    for name in joint_names:
        for found in re.finditer(r"\d+", name):
            family = f"{name[: found.start()]}#{name[found.end() :]}"
            families.setdefault(family, []).append((int(found[0]), name))
    ranked = sorted(families.values(), key=len, reverse=True)
    return [(min(own)[0], [name for _, name in sorted(own)]) for own in ranked if len(own) > 1]


def _channel(
    name: str,
    ranked: Sequence[tuple[int, Series]],
    joints: Mapping[str, str],
    keys: Sequence[str],
    joint_names: Sequence[str],
    contested: bool,
) -> ChannelColumns:
    """The best series of a channel by joint; in its own order if it counts from another number."""
    file, series = ranked[0]
    own = list(series.columns)
    if series.named or set(own) <= set(joints):
        columns = {joints.get(k, k): series.columns[k] for k in own if series.named or k in joints}
    elif len(own) == len(keys):
        order = _in_order(own)
        taken = sorted(keys, key=lambda k: int(k)) if all(k.isdecimal() for k in keys) else keys
        columns = {
            joints[p]: series.columns[k] for p, k in zip(taken, order, strict=True) if p in joints
        }
    else:
        columns = {}
    others = tuple(next(iter(s.columns.values())) for _, s in ranked[1:])
    columns = {joint: columns[joint] for joint in joint_names if joint in columns}
    own_unit = {column: key for key, column in series.columns.items()}
    units = {
        joint: unit
        for joint, column in columns.items()
        if (unit := series.units.get(own_unit[column], series.reading.unit)) is not None
    }
    return ChannelColumns(
        name, file, columns, units, series.channel == "current", contested, others
    )
