"""The one reading of a log whose columns are described: files → channels with their time stamps.

    files → columns → channels in the units, on the side and by the clocks of the file

What only a recording refuses (a cell that is no number, an array with more columns than joints) is
kept as a fault, and the rest is read all the same. Samples that are no measurement become NaN. Rows
that were logged twice are left out, and so are those by which a logger was faster than its source.

Channels read from their files, each with the time stamps that belong to it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, TypedDict

import numpy as np

from pivident.data.logs.bad_samples import bad_samples, fresh_rows, marked
from pivident.data.logs.bags.bag_table import bag_channel
from pivident.data.logs.bags.read_bag import is_bag, open_bag
from pivident.data.logs.channel_places import (
    TABLES,
    ChannelPlace,
    array_of,
    assemble,
    body_channels,
    columns_of,
    locate,
)
from pivident.data.logs.clock_alignment import ClockedChannel
from pivident.data.logs.log import CHANNELS, Description, Log
from pivident.data.logs.source_files import Frame, SourceFile, printable_name
from pivident.data.logs.tables.tables import names_in, read_table
from pivident.data.logs.timestamps import without_repeats
from pivident.data.logs.units import factor_to_si
from pivident.foundation.errors import BadCell, PividentError, RecordingError, concerning
from pivident.robot.description import Robot
from pivident.robot.naming import numbered_joints
from pivident.robot.transmission import Transmission


def stamp_channels(
    spec: Any, channels: Mapping[str, ChannelPlace], paths: Mapping[str, Path | Frame]
) -> dict[str, ChannelPlace]:
    """The columns of time stamps: one as ``t``, or one for each channel as ``t.<channel>``."""
    if spec is None:
        return {}
    by_channel = isinstance(spec, Mapping) and "columns" not in spec
    if (
        not by_channel
        and isinstance(spec, Mapping)
        and _is_bag(paths.get(str(spec.get("file")), ""))
    ):
        spec = spec["columns"]  # a bag has stamps for each of its topics
    if isinstance(spec, str) and "t" not in paths:
        # A name alone is looked up beside each channel, where these are in several files or a bag.
        in_files = {channel.file for channel in channels.values()}
        if len(in_files) > 1 or any(_is_bag(paths[file]) for file in in_files):
            spec, by_channel = dict.fromkeys(channels, spec), True
    if not by_channel:
        return {"t": locate("t", spec, paths)}
    unknown = [key for key in spec if key not in channels]
    if unknown:
        raise RecordingError(
            f"t is given for {unknown[0]!r}, which has no columns",
            advice=f"channels are {', '.join(channels)}",
        )
    found = {}
    for key, own in spec.items():
        beside = {"file": channels[key].file, "columns": own}
        found[f"t.{key}"] = locate(f"t.{key}", own if isinstance(own, Mapping) else beside, paths)
    for key in channels:  # references and inputs are logged with the positions
        if f"t.{key}" not in found and "t.q" in found and channels[key].file == channels["q"].file:
            found[f"t.{key}"] = replace(found["t.q"], name=f"t.{key}")
    return found


def read_channels(
    channels: Mapping[str, ChannelPlace],
    paths: Mapping[str, Path | Frame],
    joints: int | None,
    samples_axis: int | None,
    joint_names: Sequence[str],
) -> tuple[dict[str, np.ndarray], dict[str, ClockedChannel], list[PividentError]]:
    """Channels assembled file by file, those with own stamps, and faults (cells become NaN)."""
    values: dict[str, np.ndarray] = {}
    clocked: dict[str, ClockedChannel] = {}
    faults: list[PividentError] = []
    for key, path in paths.items():
        here = [channel for channel in channels.values() if channel.file == key]
        if not here:
            continue
        if not isinstance(path, Frame) and is_bag(path):
            clocked |= _from_bag(here, path, joint_names)
            continue
        known = path.names if isinstance(path, Frame) else names_in(path)
        needed = set()
        for channel in here:
            with concerning(*channel.keys):
                needed |= {array_of(column, known, path) for column in channel.columns}
        table = _table(path, sorted(needed), faults)
        for channel in here:
            if channel.name == "t" or channel.name.startswith("t."):
                values[channel.name] = _assembled(channel, table, 1)[:, 0]
                continue
            try:
                names = columns_of(channel.name) or joint_names
                size = len(names) if columns_of(channel.name) else joints
                values[channel.name] = _assembled(channel, table, size, samples_axis, names)
            except RecordingError as error:
                if channel.per_joint:
                    raise
                values[channel.name] = _assembled(channel, table, None, samples_axis)
                faults.append(error)
    for name in [name for name in values if name.startswith("t.")]:
        own, clock = name.removeprefix("t."), f"{channels[name].file}, {channels[name].columns[0]}"
        stamps = values.pop(name)
        if len(stamps) != len(values[own]):
            raise RecordingError(
                f"t of {own} has {len(stamps)} samples, {own} has {len(values[own])}",
                advice="name the column of stamps that was logged with it",
            ).about("columns", "t")
        clocked[own] = ClockedChannel(own, clock, stamps, values[own])
    for name, channel_of in clocked.items():
        size = len(columns_of(name)) or joints
        if size is not None and channel_of.values.shape[1] != size:
            raise RecordingError(
                f"{name} has {channel_of.values.shape[1]} column(s) for {size} joint(s)",
                advice="name one for each joint of the robot",
            ).about(*channels[name].keys)
        values[name] = channel_of.values
    return values, clocked, faults


def _assembled(channel: ChannelPlace, *given: Any) -> np.ndarray:
    """The channel as one array, with errors that say which."""
    with concerning(*channel.keys):
        return assemble(channel, *given)


def _is_bag(path: Path | Frame | str) -> bool:
    """Whether it is a bag, rather than a file of columns or a frame."""
    return not isinstance(path, Frame) and is_bag(path)


def _table(
    path: Path | Frame, names: Sequence[str], faults: list[PividentError]
) -> dict[str, np.ndarray]:
    """Columns of a file, NaN where a cell is no number."""
    if isinstance(path, Frame):
        return path.read(names)
    try:
        return read_table(path, names)
    except BadCell as error:
        from pivident.data.logs.file_columns import lenient_table

        table = lenient_table(path, names)
        if not set(names) <= set(table):  # a column of nothing but text
            raise
        faults.append(error)
        return table


def _from_bag(
    channels: Sequence[ChannelPlace], path: Path, joint_names: Sequence[str]
) -> dict[str, ClockedChannel]:
    """Channels from a bag, with the stamps of their messages."""
    bag = open_bag(path)
    clocks = {channel.name: channel.columns[0] for channel in channels}
    found = {}
    for channel in channels:
        if channel.name == "t" or channel.name.startswith("t."):
            continue
        with concerning(*channel.keys):
            found[channel.name] = bag_channel(
                bag,
                path,
                channel.name,
                channel.columns,
                channel.per_joint,
                joint_names,
                clocks.get(f"t.{channel.name}"),
            )
    return found


class Reading(TypedDict, total=False):
    """How a log is read: keywords of `read_log`."""

    units: Mapping[str, Any] | None
    side: Any
    robot: Robot | None
    transmission: Transmission | None
    joint_names: Sequence[str] | None
    rate: float | None
    resample: bool
    samples_axis: int | None
    position_offset: Sequence[float] | None
    name: str | None


def read_log(
    files: Any,
    columns: Mapping[str, Any],
    *,
    units: Mapping[str, Any] | None = None,
    side: Any = "joint",
    robot: Robot | None = None,
    transmission: Transmission | None = None,
    joint_names: Sequence[str] | None = None,
    rate: float | None = None,
    resample: bool = False,
    samples_axis: int | None = None,
    position_offset: Sequence[float] | None = None,
    name: str | None = None,
) -> Log:
    """Channels as they were logged, with the description that converts them to SI.

    Args:
        files: the log, several files by key, or a frame, as of `pivident.load_recording`; likewise:
        columns: columns of each channel.
        units: units of the log.
        side: ``joint`` or ``motor``, for all channels or by channel.
        robot: gives joint names and transmission.
        transmission: of the motors, where the robot does not give it.
        joint_names: names of the joints, where there is no robot.
        rate: sampling rate [Hz] of a log without time stamps.
        resample: whether samples are to be interpolated onto a uniform clock.
        samples_axis: axis of the samples in arrays.
        position_offset: position of each joint where the log has zero [rad or m].
        name: of the log.

    Returns:
        The log, lenient: NaN, irregular stamps and cells that are no numbers are kept as faults.

    Raises:
        FileFormatError: a file or a column cannot be read at all.
        RecordingError: columns or units without a meaning.
    """
    paths = file_paths(files)
    specs = {key: spec for key, spec in columns.items() if key not in ("inputs", "t", *TABLES)}
    specs |= body_channels(columns)
    specs |= {f"inputs.{key}": spec for key, spec in columns.get("inputs", {}).items()}
    places = {}
    for key, spec in specs.items():
        with concerning("columns", *key.split(".")):
            places[key] = locate(key, spec, paths)
    with concerning("columns", "t"):
        places |= stamp_channels(columns.get("t"), places, paths)
    if robot is not None:
        own = robot.on_fixed_base  # the joints of a measured base are in no log
        joint_names = joint_names or own.joint_names
        transmission = transmission or own.transmission
        # what is asked of a fixed base does not hold for one that floats
        robot = None if robot.base_motion == "measured" else own
    elif transmission is not None:
        joint_names = joint_names or numbered_joints(len(transmission.drive_gain))
    joints = None if joint_names is None else len(joint_names)
    logged, own_clocks, faults = read_channels(
        places, paths, joints, samples_axis, joint_names or ()
    )
    clock = places["t"].columns[0] if "t" in places else None
    stamps = {} if clock is None else {clock: logged.pop("t")}
    if units and "t" in units and own_clocks:
        with concerning("units", "t"):
            factor = factor_to_si("t", units["t"])[0]
        for key, channel in own_clocks.items():
            if channel.lead is None:  # those of a bag are in seconds
                own_clocks[key] = replace(channel, t=channel.t * factor)
    size = next(iter(logged.values())).shape[1] if logged else 0
    in_use = [paths[key] for key in dict.fromkeys(place.file for place in places.values())]
    first = places.get("q", next(iter(places.values()), None))
    log = Log(
        name or _name_of(paths[first.file] if first else next(iter(paths.values()))),
        tuple(joint_names or numbered_joints(size)),
        stamps,
        {},
        rate,
        logged,
        robot=robot,
        sources=tuple(p.source if isinstance(p, Frame) else SourceFile.of(p) for p in in_use),
        side=side.get("q", "joint") if isinstance(side, Mapping) else side,
        resample=resample,
        description=Description(units or {}, side, transmission, position_offset, clock),
        own_clocks=own_clocks,
        faults=tuple(faults),
    )
    return without_bad_samples(log)


def without_bad_samples(log: Log) -> Log:
    """The log without rows that are there twice, and NaN in place of what is no measurement."""
    log = log if log.own_clocks else _without_repeats(log)
    if not log.own_clocks and (every := fresh_rows(log.logged)) is not None:
        slower = None if log.rate is None else log.rate / every[1]
        text = (
            f"Of {len(every[0])} rows only one in {every[1]} has new values: the source is "
            f"{every[1]} times slower than the log. The others were left out."
        )
        log = replace(_of_rows(log, every[0], text), rate=slower)
    clocks = [log.own_clocks["q"].t] if "q" in log.own_clocks else list(log.columns.values())
    measured = {key: values for key, values in log.logged.items() if key in CHANNELS}
    bad = bad_samples(measured, clocks[0] if clocks else None)
    logged = log.logged | marked(measured, bad)
    own = {key: replace(c, values=logged[key]) for key, c in log.own_clocks.items()}
    return replace(log, logged=logged, own_clocks=own, bad=bad)


def _without_repeats(log: Log) -> Log:
    """The log with stamps that increase, where a few repeat the one before."""
    ((name, t),) = log.columns.items() or [("", np.empty(0))]
    if any(len(values) != len(t) for values in log.logged.values()):
        return log
    stamps, keep = without_repeats(t, log.logged.values())
    if stamps is t:
        return log
    log = replace(log, columns={name: stamps})
    moved, twice = np.flatnonzero(keep & (stamps != t)), np.flatnonzero(~keep)
    text = []
    if moved.size:
        text.append(f"{moved.size} repeat that of the row before where one is missing: corrected")
    if twice.size:
        text.append(f"{twice.size} belong to rows that were logged twice: left out")
    first = int(np.concatenate([moved, twice]).min())
    note = f"Of {len(t)} time stamps {'; '.join(text)}, the first at sample {first}."
    return _of_rows(log, keep, note)


def _of_rows(log: Log, keep: np.ndarray, note: str) -> Log:
    """Some rows of a log."""
    kept = np.array(keep if log.kept is None else log.kept)
    if log.kept is not None:
        kept[log.kept] = keep
    return replace(
        log,
        columns={key: values[keep] for key, values in log.columns.items()},
        logged={
            key: values[keep] if len(values) == len(keep) else values
            for key, values in log.logged.items()
        },
        kept=kept,
        dropped=(*log.dropped, note),
    )


def _name_of(path: Path | Frame) -> str:
    """What a log is called that nobody named."""
    return path.name if isinstance(path, Frame) else printable_name(path)


def file_paths(files: Any) -> dict[str, Path | Frame]:
    """Files by key; a single one, or a frame, is called ``log``."""
    if Frame.is_one(files):
        return {"log": Frame(files)}
    if isinstance(files, Mapping):
        return {key: Path(path) for key, path in files.items()}
    return {"log": Path(files)}
