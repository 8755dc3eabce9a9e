"""Channels read from their files, each with the time stamps that belong to it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from pivident.errors import BadCell, PividentError, RecordingError, concerning
from pivident.logs.bags.bag_channels import bag_channel
from pivident.logs.bags.read_bag import is_bag, open_bag
from pivident.logs.body_channels import columns_of
from pivident.logs.channel_places import ChannelPlace, array_of, assemble, locate
from pivident.logs.clocks.clock_alignment import ClockedChannel
from pivident.logs.file_columns import lenient_table
from pivident.logs.tables.tables import names_in, read_table


def stamp_channels(
    spec: Any, channels: Mapping[str, ChannelPlace], paths: Mapping[str, Path]
) -> dict[str, ChannelPlace]:
    """The columns of time stamps: one as ``t``, or one for each channel as ``t.<channel>``."""
    if spec is None:
        return {}
    by_channel = isinstance(spec, Mapping) and "columns" not in spec
    if (
        not by_channel
        and isinstance(spec, Mapping)
        and is_bag(paths.get(str(spec.get("file")), ""))
    ):
        spec = spec["columns"]  # a bag has stamps for each of its topics
    if isinstance(spec, str) and "t" not in paths:
        # A name alone is looked up beside each channel, where these are in several files or a bag.
        in_files = {channel.file for channel in channels.values()}
        if len(in_files) > 1 or any(is_bag(paths[file]) for file in in_files):
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
    paths: Mapping[str, Path],
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
        if is_bag(path):
            clocked |= _from_bag(here, path, joint_names)
            continue
        known = names_in(path)
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


def _table(path: Path, names: Sequence[str], faults: list[PividentError]) -> dict[str, np.ndarray]:
    """Columns of a file, NaN where a cell is no number."""
    try:
        return read_table(path, names)
    except BadCell as error:
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
