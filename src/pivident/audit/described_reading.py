"""A log whose columns are described: channels as logged, and the same in SI on the joint side.

file → columns as written → channels as logged → (factor, side) → channels in SI
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from pivident.audit.clocked_reading import aligned_channels, shown
from pivident.audit.column_names import is_clock
from pivident.audit.file_columns import clocks_in, numeric_columns, numeric_table
from pivident.audit.log import CHANNELS, Log
from pivident.errors import RecordingError
from pivident.logs.bags.read_bag import is_bag
from pivident.logs.source_files import SourceFile
from pivident.recording.channel_reading import stamp_channels
from pivident.recording.columns import Channel, array_of, assemble, locate
from pivident.recording.torque_scale import torque_scales
from pivident.recording.units import factor_to_si
from pivident.robot.description import Robot
from pivident.robot.transmission import Transmission


def described_log(
    files: str | Path | Mapping[str, str | Path],
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
    torque_timing: str | None = None,
    control_rate: float | None = None,
    delay: float | None = None,
    **unused: Any,
) -> Log:
    """A log whose columns are described as for `load_recording`, plus ``dq`` for logged speeds.

    Args:
        files: the log's file, or several by key.
        columns: columns of ``q``, ``dq``, ``tau``, the references and ``t``.
        units: unit of each channel; SI where it is not given.
        side: ``joint`` or ``motor``, for all or by channel.
        robot: gives joint names and transmission.
        transmission: instead of the robot's.
        joint_names: instead of the robot's.
        rate: declared sampling rate [Hz]; with `resample` that of the new samples.
        resample: whether a reading interpolates onto a uniform clock. The log is judged as it was
            logged all the same: interpolation would blur limits and steps of encoders.
        samples_axis: which axis of two-dimensional arrays is time.
        position_offset: added to the joint positions [rad or m].
        name: name of the log.
        torque_timing: as in a `Recording`.
        control_rate: as in a `Recording` [Hz].
        delay: as in a `Recording` [s].
        unused: further fields of a `Recording`, which an audit does not need.

    Returns:
        The log in SI units on the joint side.

    Raises:
        FileFormatError: a file or a column cannot be read.
        RecordingError: columns or units that mean nothing.
    """
    paths = (
        {k: Path(p) for k, p in files.items()}
        if isinstance(files, Mapping)
        else {"log": Path(files)}
    )
    if robot is not None:
        transmission = transmission or robot.transmission
        joint_names = joint_names or robot.joint_names
    specs = {k: s for k, s in columns.items() if k in CHANNELS and s is not None}
    places = {kind: locate(kind, spec, paths) for kind, spec in specs.items()}
    stamps_of = stamp_channels(columns.get("t"), places, paths)
    if "t" not in stamps_of and (stamps_of or any(is_bag(paths[p.file]) for p in places.values())):
        names = tuple(joint_names or ())
        logged, clocks, notes = aligned_channels(
            places | stamps_of, paths, names, samples_axis, units, rate
        )
        size = next(iter(logged.values())).shape[1] if logged else 0
        names, unit = names or tuple(f"joint_{j + 1}" for j in range(size)), "s"
    else:
        clock_place = locate("t", columns["t"], paths) if columns.get("t") is not None else None
        logged, stamps = _on_common_rows(paths, places, clock_place, joint_names, samples_axis)
        size = next(iter(logged.values())).shape[1] if logged else 0
        names = tuple(joint_names or [f"joint_{j + 1}" for j in range(size)])[: size or None]
        logged = {kind: np.array(v[:, : len(names)]) for kind, v in logged.items()}
        declared = clock_place.columns if clock_place is not None else ()
        clocks, unit, notes = clocks_in(stamps, (units or {}).get("t"), declared)
    rate = None if resample and clocks else rate  # it is not that of the stamps
    channels, commands = _to_si(logged, units or {}, side, transmission, position_offset, robot)
    first = places.get("q", next(iter(places.values()), None))
    return Log(
        name or shown(paths[first.file] if first else next(iter(paths.values()))),
        names,
        {},
        clocks,
        rate,
        logged,
        channels,
        robot,
        torque_timing or "held",
        control_rate or 0.0,
        delay or 0.0,
        commands,
        tuple(SourceFile.of(path) for path in paths.values()),
        tuple(notes),
        side.get("q", "joint") if isinstance(side, Mapping) else side,
        unit,
        torque_scales((units or {}).get("tau"), names),
        resample,
    )


def _on_common_rows(
    paths: Mapping[str, Path],
    places: Mapping[str, Channel],
    clock_place: Channel | None,
    joint_names: Sequence[str] | None,
    samples_axis: int | None,
) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
    """Channels and time columns of files whose rows belong together, as they are logged."""
    logged: dict[str, np.ndarray] = {}
    stamps: dict[str, np.ndarray] = {}
    for key, path in paths.items():
        table = numeric_table(path)
        for kind, place in places.items():
            if place.file == key:
                for column in place.columns:
                    array_of(column, list(table), path)
                joints = len(joint_names) if joint_names and place.per_joint else None
                logged[kind] = assemble(place, table, joints, samples_axis, joint_names or ())
        if clock_place is not None and clock_place.file == key:
            array_of(clock_place.columns[0], list(table), path)
            stamps[clock_place.columns[0]] = assemble(clock_place, table, 1)[:, 0]
        stamps |= {
            n: v for n, v in numeric_columns(table).items() if is_clock(n, v) and n not in stamps
        }
    return logged, stamps


def _to_si(
    logged: Mapping[str, np.ndarray],
    units: Mapping[str, Any],
    side: Any,
    transmission: Transmission | None,
    position_offset: Sequence[float] | None,
    robot: Robot | None,
) -> tuple[dict[str, np.ndarray], tuple[int, ...]]:
    """Channels in SI and on the joint side, and the joints whose command has no gain."""
    sides = side if isinstance(side, Mapping) else {"q": side, "tau": side}
    channels: dict[str, np.ndarray] = {}
    without: set[int] = set()
    for kind, values in logged.items():
        spec = units.get(kind, units.get("dq_ref") if kind == "dq" else None)
        joints = values.shape[1]
        listed = list(spec) if isinstance(spec, (list, tuple)) else [spec] * joints
        if len(listed) < joints:
            raise RecordingError(f"{kind} has {len(listed)} units for {joints} joint(s)")
        unit_of = "dq_ref" if kind == "dq" else kind
        pairs = [(1.0, False) if u is None else factor_to_si(unit_of, u) for u in listed[:joints]]
        values = values * np.array([factor for factor, _ in pairs])
        if kind == "tau" and any(command for _, command in pairs):
            gain = np.ones(joints) if transmission is None else transmission.drive_gain[:joints]
            given = transmission is not None and transmission.gain_given
            without |= {
                j for j, (_, c) in enumerate(pairs) if c and not (given is not False and given[j])
            }
            values = values * np.where([c for _, c in pairs], gain, 1.0)
        own = sides.get(kind, sides.get("q", "joint") if kind != "tau" else "joint")
        offset = np.zeros(joints) if position_offset is None else np.asarray(position_offset)
        offset = offset[:joints] if kind in ("q", "q_ref") else np.zeros(joints)
        if own == "motor" and transmission is not None:
            reduction = transmission.reduction[:joints, :joints]
            if kind == "tau":
                values = values @ reduction
            else:
                values = values @ np.linalg.inv(reduction).T
                if kind in ("q", "q_ref") and position_offset is None:
                    offset = transmission.position_offset[:joints]
        channels[kind] = values + offset
    return channels, tuple(sorted(without))
