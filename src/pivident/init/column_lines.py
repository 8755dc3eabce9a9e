"""Lines of ``[recording]``: clock, window, side, columns and units, each with its reason."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from pivident.init.assumption import Assumption, Question
from pivident.init.clock_lines import clock_place
from pivident.init.kept_joints import KeptJoints
from pivident.init.torque_unit import Comparison, TorqueUnit
from pivident.logs.bags.bag_table import OwnClock
from pivident.logs.recognition.joint_columns import JointMap
from pivident.logs.recognition.log_clock import LogClock
from pivident.logs.recognition.position_units import AssumedUnits
from pivident.text.lists import listed
from pivident.text.toml_values import string_text

#: Time before and after the motion that is kept [s].
MARGIN = 0.5


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


def side_lines(torque: TorqueUnit | None, found: Comparison) -> list[Assumption]:
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
    if measures_link_torques(torque, found):
        seen = f"the torques seem to be those of sensors behind the gears: {found.torque_side}"
        correct = 'Set "motor" if they are of the motors: then rotors and drives are in the model.'
        lines.append(Assumption("recording", "torque_side", "link", "likely", seen, correct))
    return lines


def measures_link_torques(torque: TorqueUnit, found: Comparison) -> bool:
    """Whether torques in N m contain neither rotors nor friction of drives."""
    listed = torque.value if isinstance(torque.value, list) else [torque.value]
    units = [unit.get("unit") if isinstance(unit, Mapping) else unit for unit in listed]
    in_si = all(unit in ("N m", "Nm", "N") for unit in units) and not torque.motor_side
    return in_si and found.torque_side is not None and found.torque_side.side == "link"


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
        lines[0] = _with_note(
            lines[0], f"Logged speeds ({first} …) are not needed: they follow from the positions"
        )
    return lines


def _with_note(line: Assumption, note: str) -> Assumption:
    """The same line with one more sentence."""
    return replace(line, correct=f"{line.correct} {note}.".strip())


def unit_lines(
    clock: LogClock,
    unit: AssumedUnits,
    own: Sequence[int],
    torque: TorqueUnit | None,
    besides: Mapping[str, tuple[Any, str]],
) -> list[Assumption]:
    """Unit of every channel."""
    lines = []
    if clock.column is not None:
        lines.append(Assumption("recording.units", "t", clock.unit, clock.sure, clock.seen))
    mine = AssumedUnits(tuple(unit.units[j] for j in own), unit.sure, unit.seen)
    question = None
    if unit.sure == "assumed":
        question = Question("unit of q", "In what unit are the angles?", ("rad", "deg"))
    correct = '"rad", "deg", "rev", or {unit = "counts", per_revolution = 4096}.'
    lines.append(
        Assumption("recording.units", "q", mine.value, mine.sure, mine.seen, correct, question)
    )
    if torque is not None:
        lines.append(
            Assumption(
                "recording.units", "tau", torque.value, torque.sure, torque.seen, torque.correct,
                torque.question,
            )
        )  # fmt: skip
    for name, (value, seen) in besides.items():
        lines.append(Assumption("recording.units", name, value, "likely", seen))
    return lines
