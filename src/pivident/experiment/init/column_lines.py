"""Lines of ``[recording]``: clock, window, columns and units, unnamed and measured ones included.

Logged speeds with noise of their own: columns for instruments of kind ``sensor``.

Most speeds of a log are differences of its positions, by which its clock is checked. Those of
another sensor do, and those that a drive makes of fine counts between the samples of the log.

Torques and references under names that say nothing, found by what the joints do.

A drive calls its command ``vir`` and its reference ``qg``. Where no column is named as a torque or
as a reference that the positions follow, these are looked for among the columns of unknown words,
as many as there are joints: a reference is followed by the positions, and a torque is explained by
the motion. Both are assumptions.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from pivident.data.logs.bags.bag_table import OwnClock
from pivident.data.logs.recognition.channel_words import words_of
from pivident.data.logs.recognition.log_clock import LogClock
from pivident.data.logs.recognition.log_file import ChannelColumns, JointMap, Run
from pivident.data.logs.recognition.position_units import AssumedUnits, following_unit
from pivident.data.logs.recognition.presets import Preset
from pivident.data.logs.timestamps import resample_smooth
from pivident.data.logs.units import COMMAND, POSITION, SPEED
from pivident.experiment.init.assumption import Assumption, Question
from pivident.experiment.init.clock_lines import clock_place
from pivident.experiment.init.kept_joints import KeptJoints
from pivident.experiment.init.torque_unit import Comparison, TorqueUnit
from pivident.foundation.text.numbers import percent
from pivident.foundation.text.sentences import listed
from pivident.foundation.text.toml import string_text, value_text
from pivident.judgement.audit.friction_drift import drift_text
from pivident.loop.instruments.second_sensor import SAME_SENSOR, explained_noise

#: Time before and after the motion that is kept [s].
MARGIN = 0.5
#: Samples that are compared: enough to tell 0.05 from 0.1.
COMPARED = 5000
#: Share of the motion by which positions may miss a reference.
MISSED = 0.3
#: Share of a torque that the motion must leave unexplained at most.
UNEXPLAINED = 0.2
#: Correlation with the positions from which on a column is no torque, but a copy or a command.
LIKE_POSITIONS = 0.9
#: Words of a constant that is the torque of one unit of a command.
GAIN_WORDS = set("gtau ktau kt gain gains".split())


def window_line(
    clock: LogClock, window: tuple[float, float], still: float, motion: tuple[float, float]
) -> list[Assumption]:
    """The part of the log that is kept; window [s], motion [s]."""
    start, end = float(clock.seconds[0]), float(clock.seconds[-1])
    if window != (start, end):
        zero, runs, after = 0.0, f"from {start:.6g} to {end:.6g} s", ""
        if abs(start) > end - start:  # stamps since 1970 say nothing
            zero, runs, after = start, f"for {end - start:.6g} s", " after its first stamp"
        seen = (
            f"the log runs {runs}, joints move from {motion[0] - zero:.6g} to "
            f"{motion[1] - zero:.6g} s{after} ({100 * still:.0f} % standstill in between); "
            f"{MARGIN:g} s are left on both sides"
        )
        value = [round(window[0], 3), round(window[1], 3)]
        return [Assumption("recording", "part", value, "likely", seen, "Times on the log's clock.")]
    return []


def side_lines(
    torque: TorqueUnit | None, found: Comparison, preset: Preset | None = None
) -> list[Assumption]:
    """The side of the gear, and whether torques are those of motors or of sensors behind it."""
    if torque is None:
        seen = "positions are taken for those of the joints, a motor's over its gear ratio"
        return [Assumption("recording", "side", "joint", "likely", seen, 'Or "motor".')]
    if torque.motor_side:
        value: Any = {"q": "joint", "tau": "motor"}
        return [Assumption("recording", "side", value, "likely", torque.seen, torque.correct)]
    seen = "positions and torques are taken for those of the joints, a motor's times its gear ratio"
    lines = [
        Assumption("recording", "side", "joint", "likely", seen, 'Or {q = "joint", tau = "motor"}.')
    ]
    said = preset is not None and preset.side == "link"
    by = f"the preset {preset.name} says" if preset is not None else ""
    if measures_link_torques(torque, found, preset):
        seen = f"the torques seem to be those of sensors behind the gears: {found.torque_side}"
        if said:
            seen = f"torques of sensors behind the gears, as {by}; {_side_text(found)}"
        correct = 'Set "motor" if they are of the motors: then rotors and drives are in the model.'
        lines.append(Assumption("recording", "torque_side", "link", "likely", seen, correct))
    elif said:
        seen = f"{by} sensors behind the gears, which the log contradicts: {_side_text(found)}"
        lines.append(Assumption("recording", "torque_side", None, "likely", seen, example='"link"'))
    elif (
        found.torque_side is not None
        and found.torque_side.side == "unknown"
        and measures_link_torques(torque, found, open_is_link=True)
    ):
        seen = "torques are taken for those of the motors; the log leaves open whether they are of "
        seen += f"sensors behind the gears: {found.torque_side}"
        lines.append(Assumption("recording", "torque_side", None, "likely", seen, example='"link"'))
    return lines


def _side_text(found: Comparison) -> str:
    """What the log itself shows of rotors and drives."""
    if found.torque_side is None:
        return "the log does not show whether it holds rotors and drives"
    return str(found.torque_side)


def temperature_lines(
    torque: TorqueUnit | None,
    found: Comparison,
    warm: ChannelColumns | None,
    names: Sequence[str],
    warmth: np.ndarray | None,
) -> tuple[Assumption, ...]:
    """What temperatures of the motors explain, or what their lack leaves open.

    ``warmth``: on the rows that are used, shape (samples, joints).
    """
    if warm is None or warmth is None:
        if not found.drifted:
            return ()
        seen = (
            f"with time {drift_text(found.drifted)}, and no column of motor temperatures is "
            "recognised that could tell why: friction is taken as constant. Log temperatures, "
            "warm the robot up before the record, or keep a part of one temperature (part under "
            "[recording])"
        )
        example = f"[{', '.join(string_text(f'temperature_{j}') for j in names)}]"
        return (Assumption("identify", "temperature", None, "likely", seen, example=example),)
    columns = [warm.columns[name] for name in names]
    value: Any = columns[0] if len(set(columns)) == 1 else columns
    span = f"from {warmth.min():.4g} to {warmth.max():.4g}"
    if not found.warmed:
        seen = f"motor temperatures are logged ({span}), but do not explain unseen motion better"
        example = value_text(value, 10**9)  # a comment, which is one line
        return (Assumption("identify", "temperature", None, "likely", seen, example=example),)
    line = Assumption(
        "identify", "temperature", value, "likely",
        f"motor temperatures go {span}, and with them {drift_text(found.warmed)}: friction is "
        "identified at their mean",
        "Or at another one: reference_temperature.",
    )  # fmt: skip
    listed_units = torque.value if torque is not None else "N m"
    units = listed_units if isinstance(listed_units, list) else [listed_units]
    if any(isinstance(unit, Mapping) and unit.get("unit") in COMMAND for unit in units):
        seen = "by them `pivident gains` separates magnets from friction"
        return line, Assumption("gains", "temperature", value, "likely", seen)
    return (line,)


def measures_link_torques(
    torque: TorqueUnit,
    found: Comparison,
    preset: Preset | None = None,
    open_is_link: bool = False,
) -> bool:
    """Whether torques in N m contain neither rotors nor friction of drives.

    The log decides; where it leaves that open, the preset of its logger does, or ``open_is_link``.
    """
    listed = torque.value if isinstance(torque.value, list) else [torque.value]
    units = [unit.get("unit") if isinstance(unit, Mapping) else unit for unit in listed]
    in_si = all(unit in ("N m", "Nm", "N") for unit in units) and not torque.motor_side
    shown = "unknown" if found.torque_side is None else found.torque_side.side
    said = open_is_link or (preset is not None and preset.side == "link")
    return in_si and (shown == "link" or (said and shown == "unknown"))


def column_lines(
    joints: JointMap,
    kept: KeptJoints,
    clock: LogClock,
    clock_file: int,
    others: Mapping[str, OwnClock],
    besides: Mapping[str, Any],
    keys: Mapping[str, int],
    unnamed: Mapping[str, str],
    like_torques: Sequence[str] = (),
) -> list[Assumption]:
    """Where every channel is; ``besides``: unit and reason of those that are not needed.

    ``clock_file``: number of the file with the stamps; ``unnamed``: why columns were taken whose
    names do not say what they hold, by channel.
    ``like_torques``: columns that read like torques, where none were recognised as those of joints.
    """
    numbers = {number: key for key, number in keys.items()}
    has_torque = "tau" in joints.channels
    read = ["q", "tau", *besides] if has_torque else ["q", *besides]
    lines = []
    if clock.column is not None:
        place: Any = clock_place(clock.column, others, read)
        if len(keys) > 1 and others:  # each name is looked up in the file of its channel
            own = {name: others[name].column for name in read if name in others}
            place = dict.fromkeys(read, clock.column) | own
        elif len(keys) > 1 and isinstance(place, str) and numbers[clock_file] != "t":
            place = {"file": numbers[clock_file], "columns": clock.column}
        lines.append(Assumption("recording.columns", "t", place, clock.sure, clock.seen))
    for name in read:
        channel = joints.channels[name]
        value: Any = [channel.columns[joint] for joint in kept.names]
        if len(keys) > 1 and numbers[channel.file] != name:
            value = {"file": numbers[channel.file], "columns": value}
        seen = f"by their names; {joints.seen}"
        if name in besides:
            seen = f"by their names; {besides[name][1]}"
        if name in others:
            seen += f"; it comes at {others[name].rate:.5g} Hz by a clock of its own"
        if channel.others:
            seen += f". Other series that could be meant begin with {', '.join(channel.others[:4])}"
        sure = joints.sure if name == "q" or joints.sure == "assumed" else "likely"
        if name in unnamed:
            sure, seen = "assumed", f"{unnamed[name]}; {joints.seen}"
        lines.append(Assumption("recording.columns", name, value, sure, seen))
    if not has_torque:
        seen = "no column seems to hold torques or currents of the joints; name them if there are "
        seen += "some. Without them the control law below gives the torque"
        if like_torques:
            seen += f". These read like torques: {listed(like_torques)}"
        example = f"[{', '.join(string_text(f'tau_{j}') for j in kept.names)}]"
        lines.append(Assumption("recording.columns", "tau", None, "likely", seen, example=example))
    speed = joints.channels.get("dq")
    if not {"q_ref", "dq_ref"} & besides.keys():
        seen = "no column follows the positions as their reference; name one if there is"
        lines.append(
            Assumption("recording.columns", "q_ref", None, "likely", seen, example='["r1", "r2"]')
        )
    if speed is not None and "dq" not in besides:
        first = next(iter(speed.columns.values()), "dq")
        note = f"Logged speeds ({first} …) cannot be read beside the positions."
        lines[0] = replace(lines[0], correct=f"{lines[0].correct} {note}".strip())
    return lines


def unit_lines(
    clock: LogClock,
    unit: AssumedUnits,
    own: Sequence[int],
    torque: TorqueUnit | None,
    besides: Mapping[str, tuple[Any, str]],
) -> Iterator[Assumption]:
    """Unit of every channel."""
    if clock.column is not None:
        yield Assumption("recording.units", "t", clock.unit, clock.sure, clock.seen)
    mine = AssumedUnits(tuple(unit.units[j] for j in own), unit.sure, unit.seen)
    question = None
    if unit.sure == "assumed":
        question = Question("unit of q", "In what unit are the angles?", ("rad", "deg"))
    correct = '"rad", "deg", "rev", or {unit = "counts", per_revolution = 4096}.'
    yield Assumption("recording.units", "q", mine.value, mine.sure, mine.seen, correct, question)
    if torque is not None:
        yield Assumption(
            "recording.units", "tau", torque.value, torque.sure, torque.seen, torque.correct,
            torque.question,
        )  # fmt: skip
    for name, (value, seen) in besides.items():
        yield Assumption("recording.units", name, value, "likely", seen)


def measured_speeds(
    run: Run,
    joints: JointMap,
    kept: KeptJoints,
    q: np.ndarray,
    seconds: np.ndarray,
    rows: np.ndarray,
    units: Sequence[str],
) -> dict[str, tuple[Any, str]]:
    """Unit of ``dq`` and what was seen; nothing where the log has none that can be read beside q.

    Speeds that were computed from the positions are no second sensor, but they know the clock and
    the units of the positions.

    ``q``: positions of the joints that are kept, shape (samples, joints) [rad or m];
    ``seconds``: their stamps; ``rows``: samples that are used; ``units``: of each joint's
    positions in the log.
    """
    channel = joints.channels.get("dq")
    if channel is None or not set(kept.names) <= set(channel.columns) or channel.own_clock(run):
        return {}
    values = channel.values(run, kept.names)
    one_clock = len(values) == len(q) and (np.diff(seconds[rows]) > 0.0).all()
    if not one_clock or not np.isfinite(values).all():  # a channel with gaps would be refused
        return {}
    first = max(0, (int(rows.sum()) - COMPARED) // 2)
    t, x, y = (a[rows][first : first + COMPARED] for a in (seconds, q, values))
    if not np.ptp(y, axis=0).all():
        return {}
    known = [_unit(q, dq, t, own) for q, dq, own in zip(x.T, y.T, units, strict=True)]
    if None in known:
        plain = ["m/s" if own in ("m", "mm") else "rad/s" for own in units]
        seen = "their unit is not known: they are not the derivative of the positions by the stamps"
        return {"dq": (_one_for_all(plain), seen)}
    found = [str(unit) for unit in known]
    even = np.linspace(t[0], t[-1], len(t))
    x, y = (resample_smooth(t, values, even) for values in (x, y))
    share = float(explained_noise(x, y, (len(t) - 1) / (t[-1] - t[0])).max())
    seen = (
        "its noise is not that of the positions, which explains at most "
        f"{percent(100 * max(share, 0.0))} of it: instruments may come from it"
    )
    if share > SAME_SENSOR:
        seen = "they follow from the positions; clock and units of these are checked against them"
    return {"dq": (_one_for_all(found), seen)}


def _one_for_all(units: Sequence[str]) -> Any:
    """One unit where all joints have the same, else a list."""
    return units[0] if len(set(units)) == 1 else list(units)


def _unit(q: np.ndarray, dq: np.ndarray, t: np.ndarray, unit: str) -> str | None:
    """Unit in which a logged speed follows the derivative of the position, or nothing."""
    tried = ("m/s", "mm/s") if unit in ("m", "mm") else ("rad/s", "deg/s", "rev/s", "rpm")
    match = following_unit(dq[:, None], np.gradient(q, t)[:, None], tried, SPEED)
    return None if match is None else match[0]


def followed_columns(
    run: Run, joints: JointMap, names: Sequence[str], si: np.ndarray, turning: bool
) -> JointMap:
    """The channels with ``q_ref``: what positions ``si`` (samples, joints) follow best."""
    units = ("rad", "deg", "rev") if turning else ("m", "mm")
    best, smallest = None, MISSED
    for channel in _unnamed(run, joints, "q_ref"):
        values = channel.values(run, names)
        rows = np.isfinite(values).all(axis=1) & np.isfinite(si).all(axis=1)
        match = following_unit(values[rows], si[rows], units, POSITION) if rows.any() else None
        if match is not None and 0.0 < match[1] < smallest:
            best, smallest = channel, match[1]
    return joints if best is None else _with(joints, best)


def explained_columns(
    run: Run,
    joints: JointMap,
    names: Sequence[str],
    si: np.ndarray,
    compared: Callable[[np.ndarray], Comparison],
) -> tuple[JointMap, str]:
    """The channels with ``tau``: the series that the motion explains best, and what was seen.

    ``si``: positions, shape (samples, joints); ``compared``: holds torques of the same shape
    against the description. What looks like the positions is no torque, however well these
    explain it.
    """
    best, smallest = None, UNEXPLAINED
    for channel in _unnamed(run, joints, "tau"):
        values = channel.values(run, names)
        rows = np.isfinite(values).all(axis=1) & np.isfinite(si).all(axis=1)
        alike = [
            abs(np.corrcoef(x, y)[0, 1]) for x, y in zip(values[rows].T, si[rows].T, strict=True)
        ]
        if not rows.any() or np.median(alike) > LIKE_POSITIONS:
            continue
        errors = compared(values).errors
        worst = 1.0 if errors is None else float(np.max(errors))
        if worst < smallest:
            best, smallest = channel, worst
    if best is None:
        return joints, ""
    seen = "no name says torque; the motion of the joints explains these columns up to "
    seen += f"{100 * smallest:.2g} %, as it does a torque, a current or a drive's command"
    return _with(joints, best), seen


def named_gain(run: Run, channel: ChannelColumns, size: int) -> tuple[str, np.ndarray] | None:
    """Name and values of a constant of the file that is the torque per unit of its command."""
    for name, values in run.files[channel.file].constants.items():
        if set(words_of(name)) & GAIN_WORDS and values.size in (1, size) and (values > 0).all():
            return name, np.broadcast_to(values.astype(float), size)
    return None


def _unnamed(run: Run, joints: JointMap, name: str) -> Iterator[ChannelColumns]:
    """Series without a known quantity, one column for each joint that has a position."""
    q = joints.channels["q"]
    taken = {c for channel in joints.channels.values() for c in channel.columns.values()}
    for number, file in enumerate(run.files):
        for series in file.series:
            columns = list(series.columns.values())
            same = len(columns) == len(q.columns) and file.samples == run.files[q.file].samples
            known = series.channel is not None or series.reading.foreign or taken & set(columns)
            if same and not known and all(np.nanstd(file.columns[c]) > 0.0 for c in columns):
                ordered = sorted(series.columns, key=lambda k: int(k) if k.isdecimal() else 0)
                pairs = zip(q.columns, (series.columns[k] for k in ordered), strict=True)
                yield ChannelColumns(name, number, dict(pairs), {}, False)


def _with(joints: JointMap, channel: ChannelColumns) -> JointMap:
    return replace(joints, channels=joints.channels | {channel.name: channel})
