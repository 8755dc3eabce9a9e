"""Reading below the checks of a `Recording`: whatever is a number in a file gets in.

file → columns as written → channels as logged → (factor, side) → channels in SI
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pivident.audit.clocked_reading import aligned_channels, bag_log, shown
from pivident.audit.column_names import guess_channels, is_clock
from pivident.audit.log import CHANNELS, Log
from pivident.errors import BadCell, FileFormatError, RecordingError
from pivident.recording import public_records
from pivident.recording.channel_reading import stamp_channels
from pivident.recording.columns import Channel, array_of, assemble, locate
from pivident.recording.files import SourceFile
from pivident.recording.read_bag import is_bag
from pivident.recording.read_csv import read_csv_forgiving
from pivident.recording.tables import names_in, read_table
from pivident.recording.timestamps import LIKELY_RATES, LOWEST_RATE
from pivident.recording.torque_scale import torque_scales
from pivident.recording.units import TIME, factor_to_si
from pivident.robot.description import Robot
from pivident.robot.transmission import Transmission

if TYPE_CHECKING:
    from pivident.experiment.schema import RecordingEntry

#: Public records: key of the file in its data set, and how it is to be read.
PUBLIC: dict[tuple[str, str], tuple[tuple[str, ...], dict[str, Any]]] = {
    ("staubli_tx40", "all"): (("q", "tau"), public_records.STAUBLI_TX40),
    ("emps", "estimation"): (("estimation",), public_records.EMPS),
    ("emps", "pulses"): (("pulses",), public_records.EMPS_PULSES),
    ("kuka_kr300", "A"): (("A",), public_records.KUKA_KR300),
    ("kuka_kr300", "B"): (("B",), public_records.KUKA_KR300),
}


def bare_log(path: str | Path, robot: Robot | None = None) -> Log:
    """A log of which nothing is known but its columns' names.

    Args:
        path: .csv, .txt, .tsv (also gzipped), .npz, .mat, .parquet, or a bag.
        robot: the robot, where it is known.

    Raises:
        FileFormatError: the file cannot be read at all.
    """
    path = Path(path)
    if is_bag(path):
        return bag_log(path, robot)
    columns = read_columns(path)
    clocks, unit, notes = _clocks(columns, None)
    names, joints = guess_channels(
        [n for n in columns if n not in clocks], robot.joint_names if robot else ()
    )
    logged = {kind: np.column_stack([columns[n] for n in own]) for kind, own in names.items()}
    if logged:
        taken = "; ".join(f"{kind} = {', '.join(own)}" for kind, own in names.items())
        notes.append(
            f"Columns were told from their names ({taken}) and taken for rad, N m and the joint "
            "side; an experiment file says it with certainty."
        )
    claimed = {n for own in names.values() for n in own}
    return Log(
        shown(path),
        tuple(joints),
        {n: v for n, v in columns.items() if n not in claimed},
        clocks,
        logged=logged,
        channels={kind: np.array(values) for kind, values in logged.items()},
        robot=robot,
        sources=(SourceFile.of(path),),
        notes=tuple(notes),
        clock_unit=unit,
    )


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
        rate: declared sampling rate [Hz].
        samples_axis: which axis of two-dimensional arrays is time.
        position_offset: added to the joint positions [rad or m].
        name: name of the log.
        torque_timing: as in a `Recording`.
        control_rate: as in a `Recording` [Hz].
        delay: as in a `Recording` [s].
        unused: further fields of a `Recording`, which an audit does not need.

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
        clocks, unit, notes = _clocks(stamps, (units or {}).get("t"), declared)
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
        table = _table(path)
        for kind, place in places.items():
            if place.file == key:
                for column in place.columns:
                    array_of(column, list(table), path)
                joints = len(joint_names) if joint_names and place.per_joint else None
                logged[kind] = assemble(place, table, joints, samples_axis, joint_names or ())
        if clock_place is not None and clock_place.file == key:
            array_of(clock_place.columns[0], list(table), path)
            stamps[clock_place.columns[0]] = assemble(clock_place, table, 1)[:, 0]
        stamps |= {n: v for n, v in _vectors(table).items() if is_clock(n, v) and n not in stamps}
    return logged, stamps


def entry_log(
    entry: RecordingEntry, robot: Robot | None, folder: Path, log: Path | None = None
) -> Log:
    """The log of one table ``[recording]`` of an experiment file.

    Args:
        entry: the table.
        robot: the robot.
        folder: what paths are relative to.
        log: another file with the same columns, instead of the table's.

    Raises:
        RecordingError: the log cannot be read.
        DatasetUnavailable: a public record is not here and cannot be fetched.
    """
    adjusted = {
        key: getattr(entry, key)
        for key in ("name", "control_rate", "torque_timing", "delay")
        if getattr(entry, key) is not None
    }
    if entry.dataset is not None:
        found = _public(entry.dataset, entry.run, robot, log, adjusted)
    else:
        assert entry.files is not None and entry.columns is not None, "the schema asks for both"
        files: Any = (
            {key: folder / path for key, path in entry.files.items()}
            if isinstance(entry.files, dict)
            else folder / entry.files
        )
        found = described_log(
            _instead(files, log),
            entry.columns.model_dump(exclude_unset=True),
            units=entry.units.model_dump(exclude_unset=True),
            side=entry.side,
            robot=robot,
            rate=entry.rate,
            samples_axis=entry.samples_axis,
            position_offset=entry.position_offset,
            **adjusted,
        )
    return found if entry.part is None else found.between(*entry.part)


def read_columns(path: Path) -> dict[str, np.ndarray]:
    """Every numeric column of a file; arrays of two axes column by column.

    Raises:
        FileFormatError: the file cannot be read, or holds no numbers.
    """
    columns = _vectors(_table(path))
    if not columns:
        raise FileFormatError(f"{path.name} holds no columns of numbers; export the log again")
    return columns


def _table(path: Path) -> dict[str, np.ndarray]:
    """Numeric arrays of a file; cells that are no numbers become NaN."""
    try:
        return read_table(path)
    except BadCell:
        return read_csv_forgiving(path)
    except FileFormatError:
        table: dict[str, np.ndarray] = {}
        for name in names_in(path):  # arrays of text stand between those of numbers
            try:
                table |= read_table(path, [name])
            except FileFormatError:
                continue
        if not table:
            raise
        return table


def _vectors(table: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """One-dimensional columns of a table; those of an array carry its name and their index."""
    columns: dict[str, np.ndarray] = {}
    lengths = [max(v.shape) for v in table.values() if v.ndim in (1, 2) and v.size]
    samples = max(lengths, default=0)
    for name, values in table.items():
        array = np.asarray(values, dtype=float)
        if array.ndim == 2 and array.shape[0] != samples and array.shape[1] == samples:
            array = array.T
        if array.ndim == 2 and array.shape[1] == 1:
            array = array[:, 0]
        if array.ndim == 1 and len(array) == samples:
            columns[name] = array
        elif array.ndim == 2 and len(array) == samples:
            columns |= {f"{name}[:, {j}]": array[:, j] for j in range(array.shape[1])}
    return columns


def _clocks(
    columns: Mapping[str, np.ndarray], unit: str | None, declared: Sequence[str] = ()
) -> tuple[dict[str, np.ndarray], str, list[str]]:
    """Time columns in seconds, their unit, and a sentence where it was guessed."""
    found = {
        n: np.asarray(v, float)
        for n, v in columns.items()
        if unit or n in declared or is_clock(n, v)
    }
    if not found:
        return {}, unit or "s", []
    factors, notes = {}, []
    for name, values in found.items():
        own = unit if unit and name == next(iter(found)) else _clock_unit(values)
        factors[name] = TIME.get(str(own), 1.0)
        if unit is None and own != "s":
            notes.append(f"The time stamps {name} were taken for {own}.")
    unit = unit or _clock_unit(next(iter(found.values())))
    return {n: v * factors[n] for n, v in found.items()}, unit, notes


def _clock_unit(stamps: np.ndarray) -> str:
    """Seconds, unless only another unit makes a robot's rate of the stamps."""
    steps = np.diff(stamps[np.isfinite(stamps)])
    interval = float(np.median(steps[steps > 0])) if (steps > 0).any() else 0.0
    if not interval > 1.0 / LOWEST_RATE:
        return "s"
    low, high = LIKELY_RATES
    return next((u for u, s in TIME.items() if low <= 1.0 / (interval * s) <= high), "s")


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


def _public(
    dataset: str, run: str | None, robot: Robot | None, log: Path | None, adjusted: dict[str, Any]
) -> Log:
    """A public record as it was published."""
    from pivident.recording.datasets import fetch

    chosen = run or next((r for d, r in PUBLIC if d == dataset), "")
    if (dataset, chosen) not in PUBLIC:
        known = ", ".join(f"{d} ({r})" for d, r in PUBLIC)
        raise RecordingError(
            f"there is no public record {dataset!r} {run or ''}; there are {known}"
        )
    keys, facts = PUBLIC[dataset, chosen]
    files = fetch(dataset, *keys)
    single: Any = files if len(keys) > 1 else files[keys[0]]
    machine: dict[str, Any] = {"robot": robot} if robot else {}
    if dataset == "kuka_kr300" and robot is None:
        machine = {"transmission": public_records.KR300_TRANSMISSION}
    return described_log(_instead(single, log), **(facts | machine | adjusted))


def _instead(files: Any, log: Path | None) -> Any:
    """The files of the table, or another log with the same columns."""
    if log is None:
        return files
    if isinstance(files, Mapping):
        raise RecordingError(
            f"the experiment file has {len(files)} files ({', '.join(files)}), so that {log.name} "
            "cannot take their place; audit the experiment file itself"
        )
    return log
