"""Logs whose channels have clocks of their own, read for an audit: bags, and files of two loggers.

What the audit judges is what an identification would get: the channels as they are where they have
one clock, and otherwise resampled onto one, with a sentence that says so.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from pivident.errors import FileFormatError, GapInClock
from pivident.logs.bags.bag_channels import bag_channel, joint_fields
from pivident.logs.bags.joint_topics import TopicTable
from pivident.logs.bags.read_bag import Bag, open_bag
from pivident.logs.channel_places import ChannelPlace
from pivident.logs.channel_reading import read_channels
from pivident.logs.clocks.clock_alignment import (
    ClockedChannel,
    have_one_clock,
    onto_one_clock,
)
from pivident.logs.log import Log
from pivident.logs.source_files import SourceFile
from pivident.logs.units import factor_to_si
from pivident.robot.description import Robot
from pivident.text.printable import escaped

#: Channels on their clock: values by name, clocks by name [s], and what was done.
OnOneClock = tuple[dict[str, np.ndarray], dict[str, np.ndarray], list[str]]


def shown(path: Path) -> str:
    """Name of a file as it can be printed and written: it may hold any byte."""
    return escaped(path.name.encode("utf-8", "backslashreplace").decode())


def bag_log(path: Path, robot: Robot | None = None) -> Log:
    """A bag of which nothing is known but the types of its messages.

    Args:
        path: the bag.
        robot: the robot, where it is known; its joints are looked for by name.

    Raises:
        FileFormatError: no bag, or no topic with positions and torques of these joints.
    """
    bag = open_bag(path)
    fields, joints, notes = _arm(bag, path, robot)
    channels = [
        bag_channel(bag, path, kind, [own[joint] for joint in joints], True)
        for kind, own in fields.items()
        if set(joints) <= set(own)
    ]
    logged, clocks, done = on_one_clock(channels, None)
    taken = "; ".join(f"{c.channel} = {fields[c.channel][joints[0]]} …" for c in channels)
    notes.append(
        f"Columns were told from the types of the messages ({escaped(taken)}) and taken for rad, "
        "N m and the joint side; an experiment file says it with certainty."
    )
    return Log(
        shown(path),
        tuple(robot.joint_names if robot else joints),
        {},
        clocks,
        logged=logged,
        channels={kind: np.array(values) for kind, values in logged.items()},
        robot=robot,
        sources=(SourceFile.of(path),),
        notes=tuple(notes + done),
    )


def aligned_channels(
    places: Mapping[str, ChannelPlace],
    paths: Mapping[str, Path],
    joint_names: Sequence[str],
    samples_axis: int | None,
    units: Mapping[str, Any] | None,
    rate: float | None,
) -> OnOneClock:
    """Channels described by columns, with stamps of their own, on one clock.

    Args:
        places: where channels and their stamps are.
        paths: files by key.
        joint_names: joints of the robot, where they are known.
        samples_axis: which axis of two-dimensional arrays is time.
        units: unit of each channel; that of ``t`` counts here.
        rate: declared rate [Hz].

    Raises:
        RecordingError: columns that cannot be read, or clocks that share no time.
    """
    joints = len(joint_names) or None
    _, clocked = read_channels(places, paths, joints, samples_axis, joint_names)
    factor = factor_to_si("t", units["t"])[0] if units and "t" in units else 1.0
    channels = [c if c.lead is not None else replace(c, t=c.t * factor) for c in clocked.values()]
    return on_one_clock(channels, rate)


def on_one_clock(channels: Sequence[ClockedChannel], rate: float | None) -> OnOneClock:
    """Channels as they are where they have one clock, else resampled; gaps are cut around.

    Args:
        channels: each with its stamps.
        rate: wanted where they have to be resampled [Hz].

    Raises:
        RecordingError: clocks that share no time.
    """
    if have_one_clock(channels):
        notes = list(dict.fromkeys(note for c in channels for note in c.notes))
        return {c.channel: c.values for c in channels}, {channels[0].clock: channels[0].t}, notes
    whole = [_without_holes(channel) for channel in channels]
    part: tuple[float, float] | None = None
    notes = []
    for _ in range(8):
        try:
            aligned = onto_one_clock(whole, rate, part)
        except GapInClock as gap:
            notes = [f"Only the longest stretch without gaps is looked at: {gap}."]
            part = gap.stretches.longest
            continue
        return aligned.values, {"common clock": aligned.t}, [*notes, *aligned.notes]
    aligned = onto_one_clock(whole, rate, part)
    return aligned.values, {"common clock": aligned.t}, [*notes, *aligned.notes]


def _without_holes(channel: ClockedChannel) -> ClockedChannel:
    """A channel without the samples that are NaN, which no interpolation takes."""
    good = np.isfinite(channel.values).all(axis=1) & np.isfinite(channel.t)
    if good.all():
        return channel
    note = f"{channel.channel}: {int((~good).sum())} samples that are NaN were left out."
    return replace(
        channel, t=channel.t[good], values=channel.values[good], notes=(*channel.notes, note)
    )


def _arm(
    bag: Bag, path: Path, robot: Robot | None
) -> tuple[dict[str, dict[str, str]], list[str], list[str]]:
    """Columns of each channel by joint, the joints, and what was left aside.

    Of several topics the one with most joints that have positions and torques is taken; torques
    of another topic are taken where none has both.
    """
    tables = list(bag.topics.values())
    held = {table.name: joint_fields(table) for table in tables}

    def joints_of(fields: dict[str, dict[str, str]]) -> list[str]:
        both = [j for j in fields.get("q", {}) if j in fields.get("tau", {})]
        return [j for j in robot.joint_names if j in both] if robot else both

    best = max(tables, key=lambda table: len(joints_of(held[table.name])))
    fields, joints = held[best.name], joints_of(held[best.name])
    if not joints:
        fields = _together(held, tables)
        joints = joints_of(fields)
    if not joints or (robot and len(joints) < robot.size):
        names = ", ".join(bag.names()[:6])
        wanted = f" for {', '.join(robot.joint_names[:6])}" if robot else ""
        raise FileFormatError(
            f"{shown(path)} has no topic with positions and torques{wanted}; it has "
            f"{escaped(names)} …; name them in an experiment file"
        )
    others = [t.name for t in tables if t is not best and held[t.name].get("q")]
    notes = [f"Other topics with positions: {escaped(', '.join(others[:5]))}."] if others else []
    return fields, joints, notes


def _together(
    held: Mapping[str, dict[str, dict[str, str]]], tables: Sequence[TopicTable]
) -> dict[str, dict[str, str]]:
    """Each channel from the first topic that has it."""
    found: dict[str, dict[str, str]] = {}
    for table in tables:
        for kind, own in held[table.name].items():
            found.setdefault(kind, own)
    return found
