"""Which columns of which file make up a channel of the joints or of a body.

A channel is described by

    "qm"                    one array (samples,), (samples, joints) or (joints, samples)
    "data[:, 0:6]"          a part of an array: index, range or everything along each axis
    ["q1", "q2", "q3"]      one column per joint, each again a name or a part
    {file = "torque", columns = ["tau1", "tau2"]}     the same, with the file named

A name that the file holds is taken as it is, so ``"position[0]"`` may well be a column's name.
Without a named file the channel is looked up in the file that carries the channel's own name
(``files = {q = …, tau = …}``), or else in the only file there is.

Channels that belong to a body and not to the joints: wrenches, and the pose of a base.

columns = {q = …, tau = …, wrench = {floor = ["fx", "fy", "fz", "mx", "my", "mz"]}}
    columns = {q = …, tau = …, base = {position = ["x", "y", "z"], rpy = ["r", "p", "y"]}}
"""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from pivident.foundation.errors import RecordingError, UnknownColumn
from pivident.foundation.scratch import working_array
from pivident.robot.naming import frozen_example, near_names, nearest
from pivident.robot.wrench_sensor import COMPONENTS

#: What a user may write for the columns of one channel.
ColumnSpec = str | Sequence[str] | Mapping[str, str | Sequence[str]]
_PART = re.compile(r"(?P<name>.*\S)\s*\[(?P<axes>[-\d:,\s]+)\]")
_INDEX = re.compile(r"-?\d+")
_RANGE = re.compile(r"(-?\d+)?:(-?\d+)?")
#: Tables of such channels.
TABLES = ("wrench", "base")
#: Channels of a base, and their columns.
BASE_COLUMNS = {
    "position": ("x", "y", "z"),
    "quaternion": ("x", "y", "z", "w"),
    "rpy": ("roll", "pitch", "yaw"),
    "twist": ("vx", "vy", "vz", "wx", "wy", "wz"),
}


@dataclass(frozen=True)
class ChannelPlace:
    """Where the numbers of one channel are."""

    name: str  # name of the channel, such as ``tau``
    file: str  # key of its file
    columns: tuple[str, ...]  # names or parts of arrays
    per_joint: bool  # whether there is one entry per joint, rather than one array for all

    @property
    def keys(self) -> tuple[str, ...]:
        """Its keys in the table of a recording."""
        return "columns", *self.name.split(".")


def locate(name: str, spec: ColumnSpec, files: Collection[str]) -> ChannelPlace:
    """Settle which file a channel comes from."""
    file: object = None
    columns: object = spec
    if isinstance(spec, Mapping):
        if not set(spec) <= {"file", "columns"} or "columns" not in spec:
            raise RecordingError(
                f"columns of {name}: a table needs the keys columns and file, not {', '.join(spec)}"
            )
        file, columns = spec.get("file"), spec["columns"]
    per_joint = not isinstance(columns, str)
    entries = list(columns) if isinstance(columns, (list, tuple)) else [columns]
    if not entries or not all(isinstance(entry, str) and entry for entry in entries):
        raise RecordingError(
            f"columns of {name} are {columns!r}", advice="a name or a list of names is needed"
        )
    if file is None and name in files:
        file = name
    if file is None and len(files) == 1:
        file = next(iter(files))
    if not isinstance(file, str) or file not in files:
        given = "is not decided" if file is None else f"is named {file!r}"
        raise RecordingError(
            f"the file of {name} {given}",
            advice=f"write {{file = …, columns = …}} with one of {', '.join(files)}",
        )
    return ChannelPlace(name, str(file), tuple(str(entry) for entry in entries), per_joint)


def array_of(column: str, known: Sequence[str], path: Any) -> str:
    """The array in the file that a column's description names."""
    if column in known:
        return column
    part = _PART.fullmatch(column)
    wanted = part["name"] if part else column
    if wanted not in known:
        raise UnknownColumn(path.name, wanted, near_names(wanted, known), known)
    return wanted


def assemble(
    channel: ChannelPlace,
    table: Mapping[str, np.ndarray],
    joints: int | None,
    samples_axis: int | None = None,
    joint_names: Sequence[str] = (),
) -> np.ndarray:
    """The channel as one array; returns (samples, joints)."""
    if not channel.per_joint:
        array = _part(channel, channel.columns[0], table)
        return _oriented(channel, array, joints, samples_axis, joint_names)
    columns = [_vector(channel, column, table) for column in channel.columns]
    lengths = [len(column) for column in columns]
    if len(set(lengths)) > 1:
        raise RecordingError(f"columns of {channel.name} differ in length: {lengths}")
    if joints is not None and len(columns) != joints:
        raise RecordingError(
            f"{channel.name} lists {len(columns)} column(s) for {joints} "
            f"joint(s){_listed(joint_names)}",
            advice=f"{_one_for_each(joint_names, len(columns))}",
        )
    together = working_array((lengths[0], len(columns)))
    for j, column in enumerate(columns):
        together[:, j] = column
    return together


def _part(channel: ChannelPlace, column: str, table: Mapping[str, np.ndarray]) -> np.ndarray:
    """A whole array, or the part of it that the brackets select."""
    if column in table:
        return np.asarray(table[column], dtype=float)
    part = _PART.fullmatch(column)
    assert part is not None, "array_of has seen this name"
    array = table[part["name"]]
    try:
        selected = array[tuple(_axis(axis.strip()) for axis in part["axes"].split(","))]
    except (IndexError, ValueError) as error:
        raise RecordingError(
            f"{channel.name}: {column!r} does not fit array {part['name']!r} of shape "
            f"{array.shape} ({error})"
        ) from error
    return np.asarray(selected, dtype=float)


def _axis(text: str) -> int | slice:
    """An index (``2``), a range (``0:6``, ``:3``) or everything (``:``)."""
    if _INDEX.fullmatch(text):
        return int(text)
    ends = _RANGE.fullmatch(text)
    if ends is None:
        raise ValueError(f"{text!r} is neither an index nor a range")
    return slice(*(None if end is None else int(end) for end in ends.groups()))


def _vector(channel: ChannelPlace, column: str, table: Mapping[str, np.ndarray]) -> np.ndarray:
    """One joint's samples from an array (samples,), (samples, 1) or (1, samples)."""
    array = _part(channel, column, table)
    if array.size != max(array.shape, default=0):
        raise RecordingError(
            f"{channel.name}: {column!r} has shape {array.shape}, but one joint's samples are "
            "needed",
            advice=f"select a part, such as {column + '[:, 0]'!r}",
        )
    return array.ravel()


def _oriented(
    channel: ChannelPlace,
    array: np.ndarray,
    joints: int | None,
    samples_axis: int | None,
    joint_names: Sequence[str],
) -> np.ndarray:
    """An array with time along axis 0 and joints along axis 1."""
    if array.ndim == 1:
        array = array[:, np.newaxis]
        samples_axis = 0
    if array.ndim != 2:
        raise RecordingError(
            f"{channel.name}: {channel.columns[0]!r} has shape {array.shape}",
            advice="an array of samples and joints is needed",
        )
    if samples_axis is None:
        samples_axis = _samples_axis(channel, array.shape, joints)
    array = array if samples_axis == 0 else array.T
    if joints is not None and array.shape[1] != joints:
        raise RecordingError(
            f"{channel.name}: {channel.columns[0]!r} has {array.shape[1]} column(s) for {joints} "
            f"joint(s){_listed(joint_names)}",
            advice=f"{_one_for_each(joint_names, array.shape[1])}",
        )
    return array


def _listed(joint_names: Sequence[str]) -> str:
    """The joints in brackets, where they have names."""
    return f" ({', '.join(joint_names)})" if joint_names else ""


def _one_for_each(joint_names: Sequence[str], columns: int) -> str:
    """What to do about a wrong number of columns."""
    advice = "select one for each joint"
    if columns < len(joint_names):
        return f"{advice}; joints of a URDF that did not move can be frozen, " + frozen_example(
            joint_names[-1]
        )
    return advice


def _samples_axis(channel: ChannelPlace, shape: tuple[int, ...], joints: int | None) -> int:
    """The axis that is not as long as there are joints; the longer one where both are open."""
    fits = [axis for axis in (0, 1) if joints is None or shape[1 - axis] == joints]
    if joints is None:
        return int(shape[1] > shape[0])
    if len(fits) == 1:
        return fits[0]
    reason = "both axes" if fits else "no axis"
    raise RecordingError(
        f"{channel.name}: {channel.columns[0]!r} has shape {shape}, {reason} as long as there are "
        f"joints ({joints})",
        advice="select the joints' columns, or say samples_axis = 0 or 1",
    )


def body_channels(tables: Mapping[str, Any]) -> dict[str, Any]:
    """What is said of such channels, by names such as ``wrench.floor`` and ``base.position``.

    Args:
        tables: by channel, as in the tables ``columns`` and ``units`` of a recording.

    Raises:
        RecordingError: a table is none, or a channel of a base is not known.
    """
    found = {}
    for table in TABLES:
        own = tables.get(table) or {}
        if not isinstance(own, Mapping):
            raise RecordingError(
                f"{table} is {own!r}",
                advice=f"it is a table, such as {table} = "
                + (
                    '{floor = ["fx", …]}'
                    if table == "wrench"
                    else '{position = ["x", "y", "z"], …}'
                ),
            ).about("columns", table)
        for name, said in own.items():
            if table == "base" and name not in BASE_COLUMNS:
                raise RecordingError(
                    f"a base has no channel {name!r}", advice=nearest(name, BASE_COLUMNS)
                ).about("columns", table, name)
            found[f"{table}.{name}"] = said
    return found


def columns_of(channel: str) -> tuple[str, ...]:
    """What the columns of such a channel are called; empty for a channel of joints."""
    table, _, name = channel.partition(".")
    if table == "wrench":
        return COMPONENTS
    return BASE_COLUMNS[name] if table == "base" else ()
