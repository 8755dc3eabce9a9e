"""From a lenient `Log` to a strict `Recording`: units, checks, one uniform clock, joint side.

    files ──▶ Log ──factor to SI──▶ checked channels ──clock──▶ uniform samples ──side──▶ Recording

The arguments are plain names, numbers and tables, so that an experiment file can say the same.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields, replace
from functools import partial
from pathlib import Path
from typing import Any, Literal, Unpack, get_args

import numpy as np

from pivident.data.logs.channel_places import TABLES, ColumnSpec, body_channels, columns_of
from pivident.data.logs.clock_alignment import ClockedChannel
from pivident.data.logs.log import Description, Log, factors_of, gains_of, on_joint_side, sides_of
from pivident.data.logs.read_log import read_log
from pivident.data.logs.source_files import SupportsColumns
from pivident.data.logs.torque_scale import torque_scales
from pivident.data.logs.units import UnitSpec, check_kind
from pivident.data.recording import checks
from pivident.data.recording.checks import BESIDE, RecordingOptions
from pivident.data.recording.clock import Clock, beside_torque, on_one_clock
from pivident.data.recording.measured_wrenches import with_wrenches
from pivident.data.recording.recording import CHANNELS, Recording
from pivident.data.recording.usable_samples import check_unbroken, fill_unusable, left_out_sentences
from pivident.foundation.errors import RecordingError, concerning
from pivident.foundation.scratch import working_array
from pivident.foundation.text.plain_values import plain
from pivident.robot.description import Robot
from pivident.robot.measured_base import (
    continued_quaternions,
    rotations_from_quaternions,
    rotations_from_rpy,
)
from pivident.robot.naming import nearest
from pivident.robot.transmission import Transmission

#: Its keywords that are not fields of the recording.
_OPTIONS = {
    "units", "side", "robot", "transmission", "joint_names", "resample", "samples_axis",
    "position_offset", "part",
}  # fmt: skip

#: Fields of a recording that belong to the logger and its columns, rather than to one run.
OF_LOGGER = ("control_rate", "torque_timing", "delay", "drive_delay", "torque_side")

#: Rotations whose samples jump where they pass half a turn, and what makes them go on: nothing may
#: be interpolated over a jump.
CONTINUED: dict[str, Callable[[np.ndarray], np.ndarray]] = {
    "base.quaternion": continued_quaternions,
    "base.rpy": partial(np.unwrap, axis=0),
}

#: Whether a channel was measured before or behind the gear.
Side = Literal["joint", "motor"]


def load_recording(
    files: str | Path | Mapping[str, Any] | SupportsColumns,
    columns: Mapping[str, ColumnSpec | Mapping[str, ColumnSpec]],
    *,
    units: Mapping[str, Any] | None = None,
    side: Side | Mapping[str, Side] = "joint",
    robot: Robot | None = None,
    transmission: Transmission | None = None,
    joint_names: Sequence[str] | None = None,
    rate: float | None = None,
    resample: bool = False,
    samples_axis: int | None = None,
    position_offset: Sequence[float] | None = None,
    name: str | None = None,
    part: Sequence[float] | None = None,
    **options: Unpack[RecordingOptions],
) -> Recording:
    """Read a log into a checked recording, SI and joint side.

    Args:
        files: the log's file, or several by key; a file whose key is a channel's name holds that
            channel (``{"q": "positions.csv", "tau": "currents.csv"}``).
            A ROS 2 bag is a folder, or a file like a ROS 1 bag. Or a table in memory: a frame of
            pandas or polars, or a dictionary of arrays.
        columns: columns of ``q``, and of ``tau`` (without it see `Recording.torque_source`),
            ``q_ref``, ``dq_ref``, ``ddq_ref``, ``t``, ``q_link`` (encoders behind the gear), ``dq``
            (measured speeds, of use where their noise is not that of the positions) where they
            were logged, in the notation of
            `pivident.data.logs.channel_places`; known inputs by name under ``inputs``. ``t`` is one
            column for all channels, or a table with one for each channel that has a clock of its
            own; channels from a bag have the stamps of their messages without it. Under ``wrench``
            six columns of each force sensor of the robot by its name, under ``base`` the pose of a
            floating base, see `pivident.data.logs.channel_places`.
        units: unit of each channel in the notation of `pivident.data.logs.units`, one for all
            joints or a list with one per joint; SI where it is not given. Under ``inputs``: unit
            or factor of each input.
        side: ``joint`` or ``motor`` for everything, or by channel; references are on the side of
            ``q`` if they are not named.
        robot: gives joint names, joint kinds and transmission.
        transmission: between motor and joint side, instead of the robot's.
        joint_names: names of the joints, instead of the robot's; ``joint_1`` … without a robot.
        rate: sampling rate [Hz]; that of the time stamps where it is not given.
        resample: interpolate onto a uniform grid at `rate`, or at the mean rate of the stamps,
            that of the slowest channel where they have clocks of their own: positions, references
            and torques by cubic splines, inputs held. Gaps are refused.
        samples_axis: which axis of two-dimensional arrays is time, if their shape leaves it open.
        position_offset: what is added to the joint positions, shape (joints,) [rad or m]; the
            transmission's offset for motor positions and zero for joint positions otherwise.
        name: name of the run; that of the file with the positions otherwise.
        part: read only the samples with part[0] <= t < part[1], where there are time stamps [s].
        options: further fields of `Recording`: ``control_rate``, ``torque_timing``, ``delay``,
            ``drive_delay``, ``start_time``, ``torque_side``, ``torque_scale``, ``allow_constant``,
            ``saturation`` and ``notes``.

    Returns:
        The recording.

    Raises:
        FileFormatError: a file, a column or a cell that cannot be read.
        RecordingError: channels, units, sides or time stamps that do not fit together.

    Example:
        >>> t = np.arange(4000) / 1000.0
        >>> log = np.column_stack([t, np.degrees(np.sin(t)), np.cos(t)])
        >>> np.savetxt("log.csv", log, delimiter=",", header="time,angle,torque", comments="")
        >>> columns = {"t": "time", "q": "angle", "tau": "torque"}
        >>> pv.load_recording("log.csv", columns, units={"q": "deg", "tau": "N m"})
        <Recording 'log': 4000 samples of 1 joint at 1000 Hz, 3.999 s, channels q, tau>
    """
    _check_arguments(columns, units, robot, options)
    log = read_log(
        files,
        columns,
        units=units,
        side=side,
        robot=robot,
        transmission=transmission,
        joint_names=joint_names,
        rate=rate,
        resample=resample,
        samples_axis=samples_axis,
        position_offset=position_offset,
        name=name,
    )
    fields_of: dict[str, Any] = dict(options)
    fields_of["name"] = name or Path(log.name.removesuffix(".gz")).stem
    if transmission is None:  # another one than the robot's is not stored with results
        reading = {
            "columns": columns, "units": units or {}, "side": side, "rate": rate,
            "resample": resample, "samples_axis": samples_axis, "position_offset": position_offset,
        }  # fmt: skip
        own = {k: fields_of[k] for k in OF_LOGGER if k in fields_of}
        fields_of["reading"] = plain(reading | own)
    logged, log = log.logged, replace(log, logged={})  # raw samples go as they are converted
    body = {key: logged[key] for key in logged if columns_of(key)}
    recording = _recording(log, logged, part, fields_of)
    if robot is None and body:
        raise RecordingError(
            f"{next(iter(body))} belongs to a body, and no robot is given",
            advice="give robot, with its sensors (`pivident.robot.with_wrench_sensors`)",
        ).about("columns")
    if robot is None or not (body or robot.sensors or robot.base_joints):
        return recording
    return _with_body(recording, robot, {key: logged[key] for key in body})


def _with_body(recording: Recording, robot: Robot, body: Mapping[str, np.ndarray]) -> Recording:
    """The recording with what belongs to bodies: wrenches, and the pose of a base."""
    wrenches = {
        key.removeprefix("wrench."): own for key, own in body.items() if key.startswith("wrench.")
    }
    position, pose = body.get("base.position"), None
    turned = [key for key in ("base.quaternion", "base.rpy") if key in body]
    if position is not None or turned:
        if position is None or len(turned) != 1:
            raise RecordingError(
                "the pose of the base is position and either quaternion or rpy",
                advice="map "
                'base = {position = ["x", "y", "z"], quaternion = ["qx", "qy", "qz", "qw"]}',
            ).about("columns", "base")
        made = rotations_from_quaternions if turned == ["base.quaternion"] else rotations_from_rpy
        pose = position, made(body[turned[0]])
    return with_wrenches(recording, robot, wrenches, pose, body.get("base.twist"))


def recording_from(
    log: Log, *, part: Sequence[float] | None = None, **options: Unpack[RecordingOptions]
) -> Recording:
    """A log made strict: checked, on one uniform clock, in SI on the joint side.

    Args:
        log: the log, with its description.
        part: first and last instant to keep [s]; None: all of it.
        options: fields of the recording, as of `load_recording`.

    Returns:
        The recording.

    Raises:
        RecordingError: a channel, a sample or the clock cannot be used; names which.
    """
    return _recording(log, dict(log.logged), part, {"name": log.name} | options)


def _recording(
    log: Log,
    logged: dict[str, np.ndarray],
    part: Sequence[float] | None,
    options: Mapping[str, Any],
) -> Recording:
    """A log made strict; its channels as logged are taken out of ``logged`` one by one."""
    if log.faults:
        raise log.faults[0]
    said, robot, joint_names = log.description, log.robot, log.joint_names
    clocked = dict(log.own_clocks)
    if said.clock is not None:
        logged["t"] = log.columns[said.clock]
    _check_sizes(len(joint_names), robot, said.transmission)
    with concerning("side"):
        sides = _checked_sides(said, logged)
    others = ("inputs", *TABLES, "t") if clocked else ("inputs", *TABLES)
    units = {key: unit for key, unit in said.units.items() if key not in others}
    units |= {f"inputs.{key}": unit for key, unit in said.units.get("inputs", {}).items()}
    units |= body_channels(said.units)
    for channel, unit in units.items():
        _to_si(logged, channel, unit, sides, robot, said.transmission)
    for channel, values in logged.items():
        if channel != "t":
            own = clocked[channel].t if channel in clocked else logged["q"]
            names = columns_of(channel) or joint_names
            checks.check_shape(channel, values, (len(own), len(names)))
            if channel not in CHANNELS:
                checks.check_finite(channel, values, names)
    stamps = _stamps(log, logged, clocked)
    with concerning("part"):
        check_unbroken(logged["q"], stamps["q"], part)
    usable = fill_unusable(logged, joint_names, logged["q"].shape[1])
    # Limits are judged on the log itself: couplings and interpolation would blur them.
    if "tau" in logged and options.get("saturation", "refuse") == "refuse":
        moving = beside_torque(logged, clocked)
        checks.check_not_saturated("tau", logged["tau"], moving, joint_names)

    for channel, continued in CONTINUED.items():
        if channel in logged:
            logged[channel] = continued(logged[channel])
    clock = Clock(log.rate, log.resample, "t" in said.units, part)
    with concerning("columns", "t"):
        found = on_one_clock(logged, clocked, clock)
    grid = found.start + np.arange(len(logged["q"])) / found.rate
    mixed = sides["tau"] == "motor" and said.transmission is not None
    valid = usable.on(grid, stamps, said.transmission.reduction if mixed else None)  # type: ignore[union-attr]
    with concerning("position_offset"):
        _to_joint_side(logged, sides, said)
    if robot is not None:
        for channel in ("q", "q_ref"):
            if channel in logged:
                checks.check_within_reach(channel, logged[channel], robot, said.units.get(channel))
    for values in logged.values():
        values.flags.writeable = False  # the recording then keeps it instead of a copy
    content: dict[str, Any] = {key: logged[key] for key in CHANNELS if key in logged}
    if "tau" not in logged:
        content |= {"tau": np.zeros_like(logged["q"]), "torque_source": "none"}
    content["inputs"] = {
        key.removeprefix("inputs."): logged[key] for key in logged if key.startswith("inputs.")
    }
    content["temperature"] = logged.get("temperature")
    content["torque_scale"] = torque_scales(said.units.get("tau"), joint_names)
    left_out = left_out_sentences(log.bad, joint_names, len(stamps["q"]))
    content |= {"start_time": found.start, "notes": (*log.dropped, *left_out, *found.notes)}
    content |= {"slowed": found.slowed, "valid": valid}
    return Recording(
        joint_names=joint_names, rate=found.rate, sources=log.sources, **content | dict(options)
    )


def _stamps(
    log: Log, logged: Mapping[str, np.ndarray], clocked: Mapping[str, ClockedChannel]
) -> dict[str, np.ndarray]:
    """Instants of positions and torques as they were logged, shape (samples,) each [s]."""
    if clocked:
        t = {key: clocked[key].t for key in ("q", "tau") if key in clocked}
    else:
        t = {"q": logged.get("t", np.arange(len(logged["q"])) / (log.rate or 1.0))}
    return {"tau": t["q"]} | t


def _check_arguments(columns: Any, units: Any, robot: Any, options: Mapping[str, Any]) -> None:
    """Refuse arguments of another kind, and options that a recording does not have."""
    tables = {"columns": '{"q": ["q1", "q2"], "tau": ["tau1", "tau2"]}'}
    tables["units"] = '{"q": "deg", "tau": "N m"}'
    for name, given in (("columns", columns), ("units", units)):
        if not isinstance(given, Mapping) and not (name == "units" and given is None):
            raise RecordingError(
                f"{name} is {given!r}", advice=f"give a table by channel, such as {tables[name]}"
            )
    known_tables = (*CHANNELS, "temperature", "t", "inputs", *TABLES)
    unknown = [key for key in columns if key not in known_tables]
    if unknown:
        raise RecordingError(
            f"columns are given for {unknown[0]!r}",
            advice=f"channels are {', '.join(known_tables)}",
        )
    if "q" not in columns:
        raise RecordingError("no columns are given for q", advice="name those that hold it")
    if robot is not None and not isinstance(robot, Robot):
        raise RecordingError(
            f"robot is {robot!r}", advice=f"give a Robot, such as load_robot({robot!r})"
        )
    made_here = {*CHANNELS, "inputs", "sources", "slowed", "reading", "torque_source"}
    made_here |= {"wrenches", *BESIDE}
    known = {field.name for field in fields(Recording)} - made_here
    for name in options:
        if name not in known:
            raise RecordingError(
                f"load_recording has no option {name!r}",
                advice=nearest(name, sorted(known | _OPTIONS)),
            )


def _check_sizes(joints: int, robot: Robot | None, transmission: Transmission | None) -> None:
    """Refuse a robot or a transmission of another number of joints."""
    sizes = {} if robot is None else {f"robot {robot.name!r}": robot.size}
    sizes |= {} if transmission is None else {"the transmission": len(transmission.drive_gain)}
    for owner, size in sizes.items():
        if size != joints:
            raise RecordingError(
                f"{owner} has {size} joint(s), the recording {joints}",
                advice="select the same joints",
            )


def _checked_sides(said: Description, logged: Mapping[str, np.ndarray]) -> dict[str, Side]:
    """Side of each channel that has one."""
    given = dict(said.side) if isinstance(said.side, Mapping) else {"q": said.side}
    for channel, value in given.items():
        if channel == "q_link" and value != "joint":  # flexible joints
            raise RecordingError("q_link is the encoder behind the gear: its side is joint")
        if channel not in CHANNELS or value not in get_args(Side):
            raise RecordingError(f"side of {channel} is {value!r}", advice="choose joint or motor")
    sides = sides_of(said.side)
    if said.transmission is None and "motor" in {sides[c] for c in logged if c in sides}:
        raise RecordingError(
            "channels are on the motor side", advice="give a robot or a transmission"
        )
    return sides


def _to_si(
    logged: dict[str, np.ndarray],
    channel: str,
    spec: Any,
    sides: Mapping[str, Side],
    robot: Robot | None,
    transmission: Transmission | None,
) -> None:
    """Turn a channel into SI units, on the side it was logged on."""
    with concerning("units", *channel.split(".")):
        if channel not in logged:
            raise RecordingError(f"a unit is given for {channel}, which has no columns")
        joints = 1 if channel == "t" else logged[channel].shape[1]
        listed = isinstance(spec, (list, tuple))
        per_joint: list[UnitSpec] = list(spec) if listed else [spec] * joints
        if len(per_joint) != joints:
            raise RecordingError(
                f"{channel} has {len(per_joint)} units for {joints} joint(s)",
                advice="give one for all or one for each",
            )
        if robot is not None and channel in ("q", "q_ref", "q_link") and sides[channel] == "joint":
            for joint, unit in zip(robot.joints, per_joint, strict=True):
                check_kind(channel, unit, joint.name, joint.kind)
        factors, commands = factors_of(channel, per_joint)
        if (factors != 1.0).any():
            logged[channel] = _scaled(logged[channel], factors)
        if commands.any():
            gains, without = gains_of(commands, transmission)
            if without:
                unit = str(per_joint[without[0]])
                whose = "" if robot is None else f" of joint {robot.joints[without[0]].name!r}"
                raise RecordingError(
                    f"{channel}{whose} is a drive command in {unit!r} without a gain",
                    advice="write "
                    f'{channel} = {{unit = "{unit}", gain = N m (or N) per {unit}}} under units, '
                    "or drive_gain under [robot]; a torque constant of the motor also needs "
                    'reduction there and side = {tau = "motor"}. Where no gain is known, '
                    "`pivident gains` finds them from a known payload, and their ratios without "
                    f"one; with --in-log-units it identifies every motor in {unit}",
                )
            logged[channel] = _scaled(logged[channel], gains)


def _scaled(values: np.ndarray, factors: np.ndarray) -> np.ndarray:
    """Each column times its factor, in a working array of its own."""
    return np.multiply(values, factors, out=working_array(values.shape))


def _to_joint_side(
    logged: dict[str, np.ndarray], sides: Mapping[str, Side], said: Description
) -> None:
    """Bring every channel behind the gear."""
    joints = logged["q"].shape[1]
    if said.position_offset is not None and np.shape(said.position_offset) != (joints,):
        raise RecordingError(f"position_offset needs one number for each of {joints} joint(s)")
    for channel in CHANNELS:
        if channel in logged:
            logged[channel] = on_joint_side(channel, logged[channel], sides, said)
