"""The table ``[recording]`` and the joints of ``[robot]``: columns, units, clock, useful window."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pivident.data.logs.bad_samples import bad_samples, marked
from pivident.data.logs.file_columns import beside_text
from pivident.data.logs.recognition.channel_words import plain_channel
from pivident.data.logs.recognition.log_clock import (
    LogClock,
    is_usable_clock,
    names_time,
    read_clock,
    speed_rate,
)
from pivident.data.logs.recognition.log_file import (
    ChannelColumns,
    JointMap,
    LogFile,
    Run,
    joint_map,
    temperature_columns,
)
from pivident.data.logs.recognition.position_units import (
    AssumedUnits,
    counts_in,
    following_unit,
    position_factor,
    position_unit,
)
from pivident.data.logs.recognition.presets import Preset
from pivident.data.logs.tables.tables import without_header
from pivident.data.logs.timestamps import stretches
from pivident.data.logs.units import POSITION, SPEED, TORQUE
from pivident.experiment.init.assumption import Answers, Assumption, DraftError
from pivident.experiment.init.clock_lines import (
    as_the_joints_move,
    clock_lines,
    control_rate_line,
)
from pivident.experiment.init.column_lines import (
    MARGIN,
    column_lines,
    explained_columns,
    followed_columns,
    measured_speeds,
    measures_link_torques,
    named_gain,
    side_lines,
    temperature_lines,
    unit_lines,
    window_line,
)
from pivident.experiment.init.kept_joints import KeptJoints, RobotFile, kept_joints
from pivident.experiment.init.torque_unit import (
    Comparison,
    TorqueUnit,
    compare,
    torque_unit,
    without_torque,
)
from pivident.foundation.text.sentences import listed
from pivident.judgement.audit.standstill import motion_window
from pivident.robot.description import Robot
from pivident.robot.mjcf_actuators import ActuatorLaw, actuator_law
from pivident.robot.naming import MJCF_FILES, nearest

#: Standstill at the ends that is worth cutting off [s].
WORTH_CUTTING = 1.0

#: Rows with positions of all joints, at least; fewer are no log.
MIN_ROWS = 10

#: Tracking error below which a reference is only a copy of the measurement, relative.
COPY = 1e-6

#: Correlation with a numbered reference from which on a joint follows it and no other.
FOLLOWS = 0.95

#: Samples whose mean speed is compared with a command.
MEAN_OF = 10


@dataclass(frozen=True, eq=False)
class RecordingLines:
    """What was found out about one log."""

    machine: Robot  # the robot with the joints that are identified
    robot: tuple[Assumption, ...]  # lines of ``[robot]`` that follow from the log
    recording: tuple[Assumption, ...]  # lines of ``[recording]`` and its tables, but for the files
    file_keys: dict[str, int]  # number of each file in the run, by its key
    has_reference: bool  # whether a reference of the positions was found
    rate: float  # sampling rate [Hz]
    comparison: Comparison  # torque and motion against the description; empty without torque
    link_torques: bool  # whether the torques are those of sensors behind the gears
    has_torque: bool = True  # whether a torque was found
    law: ActuatorLaw | None = None  # of the actuators of an MJCF, where no torque was found
    warmth: tuple[Assumption, ...] = ()  # lines that follow from temperatures


def recording_lines(
    run: Run, machine: RobotFile, wanted: tuple[str, ...], answers: Answers
) -> RecordingLines:
    """Everything that is assumed about one log."""
    joints = _of_its_joints(_joint_map(run, machine, wanted))
    if "q" not in joints.channels:
        raise _not_found("position", run)
    run = _without_bad_samples(run, joints)
    kept = kept_joints(run, joints, machine, wanted)
    clock, clock_file = _clock(run, joints, kept, answers)
    q = joints.channels["q"]
    logged = machine.robot(kept.logged if machine.is_open else None)
    raw = q.values(run, logged.joint_names)
    own = [logged.joint_names.index(name) for name in kept.names]
    torques = joints.channels.get("tau")
    rows = np.isfinite(raw[:, own]).all(axis=1)
    rows[list(clock.twice)] = False
    if rows.sum() < MIN_ROWS:
        raise DraftError(
            f"{int(rows.sum())} of {len(rows)} rows of {run.files[q.file].shown} have a position "
            f"of every joint ({', '.join(kept.names)})",
            advice="export the joints on one clock without empty cells, or a longer log",
        )
    kind = run.files[q.file].preset
    said = kind.name if kind is not None and kind.says("q") else ""
    unit = position_unit(logged, raw[rows], q.units, answers.get("unit of q"), said)
    si = raw * unit.factors(POSITION)
    if all(c.own_clock(run) is None for c in joints.channels.values()):
        clock = as_the_joints_move(clock, si[:, own])
    first, last, still = motion_window(si[rows][:, own], clock.seconds[rows])
    frozen = _frozen(machine, logged, kept, si, clock, (first, last))
    robot = machine.robot(kept.names, {n: v for n, (v, _) in frozen.items()})
    window = _window(clock, first, last)
    rows &= (clock.seconds >= window[0]) & (clock.seconds <= window[1])
    torque: TorqueUnit | None = None
    preset: Preset | None = None
    warm: ChannelColumns | None = None
    warmth: np.ndarray | None = None
    found = without_torque(robot)
    unnamed: dict[str, str] = {}
    if "tau" not in joints.channels and not _references(
        run, joints, kept, si[:, own], clock, unit, own
    ):

        def compared(tau: np.ndarray) -> Comparison:
            used = rows & np.isfinite(tau).all(axis=1)
            return compare(robot, si[used][:, own], tau[used], clock.seconds[used])

        joints, seen = explained_columns(run, joints, kept.names, si[:, own], compared)
        if seen:
            unnamed["tau"] = seen
            turning = any(unit.units[j] not in ("m", "mm") for j in own)
            joints = followed_columns(run, joints, kept.names, si[:, own], turning)
            if "q_ref" in joints.channels:
                unnamed["q_ref"] = "no name says reference, but the positions follow these columns"
        torques = joints.channels.get("tau")
    logged_torque = () if torques is None else ("tau",)
    if torques is not None:
        tau = torques.values(run, kept.names)
        named = next(iter(torques.units.values()), None)
        tau = tau * TORQUE.get(answers.get("unit of tau", named or ""), 1.0)
        rows &= np.isfinite(tau).all(axis=1)
        warm = temperature_columns(run, q)
        warmth = None if warm is None else warm.values(run, kept.names)[rows]
        found = compare(robot, si[rows][:, own], tau[rows], clock.seconds[rows], warmth)
        if found.angle_unit and unit.sure != "certain":
            unit = _other_angle(unit)
            si = raw * unit.factors(POSITION)
            found = compare(robot, si[rows][:, own], tau[rows], clock.seconds[rows], warmth)
        gain = named_gain(run, torques, len(kept.names)) if unnamed else None
        preset = run.files[torques.file].preset
        torque = torque_unit(
            robot, found, named, torques.is_current, answers.get("unit of tau"), gain, preset
        )
    joints = _as_references_follow(run, joints, kept, si[:, own])
    references = _references(run, joints, kept, si[:, own], clock, unit, own)
    speeds = measured_speeds(
        run, joints, kept, si[:, own], clock.seconds, rows, [unit.units[j] for j in own]
    )
    if torque is None and "q_ref" not in references:
        raise _not_found("torque", run)
    besides = references | speeds
    keys = _file_keys(joints, ("q", *logged_torque, "q_ref", "dq_ref", *speeds))
    if clock.column is not None and clock_file not in keys.values():
        keys = {"t": clock_file} | ({"q": q.file} if "log" in keys else keys)
    used = (*logged_torque, *besides)
    others = {n: c for n in used if (c := joints.channels[n].own_clock(run)) is not None}
    law = None
    if torque is None and machine.name.endswith(MJCF_FILES):
        law = actuator_law(machine.name, kept.names)
    lines = [
        *clock_lines(clock, others, float(answers["rate"]) if "rate" in answers else None),
        *(control_rate_line(clock, law.step) if law is not None and not law.reasons else ()),
        *window_line(clock, window, still, (first, last)),
        *side_lines(torque, found, preset),
        *column_lines(
            joints, kept, clock, clock_file, others, besides, keys, unnamed, _like_torques(run)
        ),
        *unit_lines(clock, unit, own, torque, besides),
    ]
    return RecordingLines(
        robot,
        (*_joint_lines(machine, joints, kept, frozen), *_mounting_lines(machine, found)),
        tuple(lines),
        keys,
        "q_ref" in references,
        clock.rate,
        found,
        torque is not None and measures_link_torques(torque, found, preset),
        torque is not None,
        law,
        temperature_lines(torque, found, warm, kept.names, warmth),
    )


def _mounting_lines(machine: RobotFile, found: Comparison) -> list[Assumption]:
    """Bodies and gravity as somebody gave them, else none where the torques hold none."""
    given = machine.given.lines(found.no_gravity)
    if not found.no_gravity or machine.given.gravity is not None:
        return given
    correct = "Leave it out if the torques hold gravity, or log those that do."
    none = Assumption("robot", "gravity", [0.0, 0.0, 0.0], "likely", found.no_gravity, correct)
    return [*given, none]


def _joint_map(run: Run, machine: RobotFile, wanted: tuple[str, ...]) -> JointMap:
    """Columns of all joints; as many as are requested are theirs, where no name says more."""
    joints = joint_map(run, machine.joint_names)
    q = joints.channels.get("q")
    if not wanted or joints.sure == "certain" or q is None or len(q.columns) != len(wanted):
        return joints
    seen = "as many columns as joints were requested, taken for them in order"
    return replace(joint_map(run, wanted), sure="likely", seen=seen)


def _of_its_joints(joints: JointMap) -> JointMap:
    """The channels without a torque of other joints than those that have positions."""
    q, tau = joints.channels.get("q"), joints.channels.get("tau")
    if q is None or tau is None or set(q.columns) & set(tau.columns):
        return joints
    return replace(joints, channels={k: c for k, c in joints.channels.items() if k != "tau"})


def _without_bad_samples(run: Run, joints: JointMap) -> Run:
    """The run with NaN in place of positions and torques that are no measurement."""
    named = {k: c for k, c in joints.channels.items() if k in ("q", "tau")}
    measured = {k: c.values(run, list(c.columns)) for k, c in named.items()}
    files = [dict(file.columns) for file in run.files]
    for key, values in marked(measured, bad_samples(measured)).items():
        if values is not measured[key]:
            files[named[key].file] |= zip(named[key].columns.values(), values.T, strict=True)
    return Run(tuple(replace(f, columns=c) for f, c in zip(run.files, files, strict=True)))


def _like_torques(run: Run) -> list[str]:
    """Names of columns that read like torques, whatever they belong to."""
    return [name for file in run.files for name in file.columns if plain_channel(name) == "tau"]


def _not_found(what: str, run: Run) -> DraftError:
    """That no column seems to hold a channel, and what columns there are."""
    called = {f.shown: [f.title(name) for name in f.columns] for f in run.files}
    if refused := without_header(called):
        return DraftError.of_part("", refused)
    names = [name for own in called.values() for name in own]
    near = nearest(what, names)
    hint = f"; {near}" if near.meant else ""
    if what == "torque":
        hint += ", nor references of the positions, from which a known control law would give them"
    if not _like_torques(run):
        hint += ". Without torques, and without the gains of a control law, only delays and ratios "
        hint += "of gains can be had"
    beside = "".join(beside_text(file.beside) for file in run.files)
    return DraftError(
        f"no column of {', '.join(called)} seems to hold {what}s of joints",
        advice=f"there are {listed(_families(names), 12)}{beside}{hint}. Rename the columns "
        "(q_1, tau_1 …), or write the experiment file by hand",
    )


def _families(names: Sequence[str]) -> list[str]:
    """Names of columns, those of one array or list together: ``action[26]``."""
    of_name = {name: re.split(r"\[|\.(?=[^.]*$)", name)[0] for name in names}
    sizes = Counter(of_name.values())
    shown = [f"{of_name[n]}[{sizes[of_name[n]]}]" if sizes[of_name[n]] > 1 else n for n in names]
    return list(dict.fromkeys(shown))


def _clock(run: Run, joints: JointMap, kept: KeptJoints, answers: Answers) -> tuple[LogClock, int]:
    """Clock of the positions and the number of its file; those of other files must agree with it.

    It may lie in a file of its own with the same rows.
    """
    q, dq = joints.channels["q"], joints.channels.get("dq")
    hint = None
    names = [n for n in kept.names if dq is not None and n in dq.columns]
    if dq is not None and names:
        hint = speed_rate(q.values(run, names), dq.values(run, names))
    given = float(answers["rate"]) if "rate" in answers else None
    base = run.files[q.file]
    stamps = {k: _stamps(file) for k, file in enumerate(run.files) if file.samples == base.samples}
    number = next((k for k in (q.file, *stamps) if stamps[k]), q.file)
    columns = base.columns if number == q.file else stamps[number]
    titles = {run.files[number].title(name): name for name in columns}
    clock = read_clock({title: columns[name] for title, name in titles.items()}, hint, given)
    clock = replace(clock, column=titles.get(clock.column or ""))
    for k, other in enumerate(_stamps(file).get(clock.column or "") for file in run.files):
        if other is None or k == number:
            continue
        here = run.files[number].columns[clock.column or ""]
        worst = float(np.max(np.abs(other - here)))
        if not worst <= 0.5 * float(np.median(np.diff(here))):
            raise DraftError(
                f"the time stamps of {run.files[k].shown} differ from those of "
                f"{run.files[number].shown} by up to {worst:.4g} {clock.unit}",
                advice="join the files by their stamps first",
            )
    return clock, number


def _stamps(file: LogFile) -> dict[str, np.ndarray]:
    """Columns that can be time stamps, by their names or by that of a file with only one."""
    alone = len(file.columns) == 1 and names_time(file.path.name.partition(".")[0])
    return {
        name: values
        for name, values in file.columns.items()
        if is_usable_clock("t" if alone else (title := file.title(name)), values)
        and (alone or names_time(title))
    }


def _window(clock: LogClock, first: float, last: float) -> tuple[float, float]:
    """The motion with a margin; the whole log where little would be cut off.

    Beside messages that were stamped together it is the longest stretch of the motion.
    """
    start, end = float(clock.seconds[0]), float(clock.seconds[-1])
    low, high = max(start, first - MARGIN), min(end, last + MARGIN)
    if clock.together:
        return stretches(clock.seconds[(clock.seconds >= low) & (clock.seconds <= high)]).longest
    if (low - start) + (end - high) < WORTH_CUTTING:
        return start, end
    return low, high


def _frozen(
    machine: RobotFile,
    logged: Robot,
    kept: KeptJoints,
    si: np.ndarray,
    clock: LogClock,
    motion: tuple[float, float],
) -> dict[str, tuple[float, float]]:
    """Median position of logged joints that are not identified, and their range [rad or m]."""
    if not machine.is_open:
        return {}
    inside = (clock.seconds >= motion[0]) & (clock.seconds <= motion[1])
    found = {}
    for j, name in enumerate(logged.joint_names):
        values = si[inside, j][np.isfinite(si[inside, j])]
        if name not in kept.names and values.size:
            found[name] = (float(f"{np.median(values):.5g}"), float(np.ptp(values)))
    return found


def _joint_lines(
    machine: RobotFile,
    joints: JointMap,
    kept: KeptJoints,
    frozen: Mapping[str, tuple[float, float]],
) -> list[Assumption]:
    """Which joints are identified."""
    if not machine.is_tree and kept.names == machine.joint_names:
        return []
    seen = f"{joints.seen}; {len(kept.names)} of {len(machine.joint_names)} joints move"
    seen += " and have a torque signal" if "tau" in joints.channels else ""
    if kept.left_out:
        seen += ". Left out: " + ", ".join(f"{n} ({why})" for n, why in kept.left_out.items())
    correct = "The order is that of the columns below; remove a joint in both places."
    lines = [Assumption("robot", "joints", list(kept.names), joints.sure, seen, correct)]
    if frozen:
        moving = [f"{n} by {span:.3g}" for n, (_, span) in frozen.items() if span > 0.05]
        seen = "joints that are logged but not identified stand at their median position"
        if moving:
            seen += (
                f", although they move ({', '.join(moving)} rad or m): their motion is model error"
            )
        values = {name: value for name, (value, _) in frozen.items()}
        sure = "assumed" if moving else "likely"
        lines.append(
            Assumption("robot", "frozen", values, sure, f"{seen}. All others stand at zero")  # type: ignore[arg-type]
        )
    elif len(kept.names) < len(machine.joint_names) + len(machine.fixed):
        seen = "joints that the log does not name stand at zero; name those that do not"
        lines.append(
            Assumption("robot", "frozen", None, "likely", seen, example="{gripper_joint = 0.02}")
        )
    return lines


def _file_keys(joints: JointMap, channels: Sequence[str]) -> dict[str, int]:
    """A key for each file that is used: the first channel that it holds."""
    keys: dict[str, int] = {}
    for name in channels:
        channel = joints.channels.get(name)
        if channel is not None and channel.file not in keys.values():
            keys[name] = channel.file
    return {"log": next(iter(keys.values()))} if len(keys) == 1 else keys


def _as_references_follow(run: Run, joints: JointMap, kept: KeptJoints, si: np.ndarray) -> JointMap:
    """References that have numbers instead of names, each given to the joint that follows it.

    A controller numbers its joints in an order of its own, whatever that of the joint states is.
    """
    channel = _reference_channel("q_ref", run, joints, kept)
    named = channel is None or any(n in c for n, c in channel.columns.items())
    if channel is None or named or len(kept.names) < 2:
        return joints
    values = channel.values(run, kept.names)
    rows = np.isfinite(values).all(axis=1) & np.isfinite(si).all(axis=1)
    both = np.column_stack([si[rows], values[rows]])
    if not rows.any() or not np.ptp(both, axis=0).all():
        return joints
    alike = np.corrcoef(both.T)[: len(kept.names), len(kept.names) :]
    best = alike.argmax(axis=1)
    follows = alike.max(axis=1).min() > FOLLOWS and len(set(best.tolist())) == len(best)
    if not follows or alike.diagonal().min() > FOLLOWS:  # joints may move alike
        return joints
    columns = [channel.columns[name] for name in kept.names]
    moved = dict(zip(kept.names, (columns[k] for k in best), strict=True))
    own = replace(channel, columns={**channel.columns, **moved})
    return replace(joints, channels=joints.channels | {"q_ref": own})


def _references(
    run: Run,
    joints: JointMap,
    kept: KeptJoints,
    si: np.ndarray,
    clock: LogClock,
    unit: AssumedUnits,
    own: list[int],
) -> dict[str, tuple[Any, str]]:
    """References that follow the measurement, with their unit and what was seen."""
    found: dict[str, tuple[Any, str]] = {}
    turning = [k for k, j in enumerate(own) if unit.units[j] not in ("m", "mm")]
    judged = turning or list(range(len(own)))
    position = _reference_channel("q_ref", run, joints, kept)
    followed = si
    if position is not None:
        values = position.values(run, kept.names)  # may begin later, end earlier, have own gaps
        rows = np.isfinite(values).all(axis=1) & np.isfinite(si).all(axis=1)
        names = ("rad", "deg", "rev") if turning else ("m", "mm")
        counts = {u: position_factor(u, {}) for u in set(unit.units) if counts_in(u)}
        table = POSITION | counts
        match = following_unit(
            values[rows][:, judged], si[rows][:, judged], (*names, *counts), table
        )
        if match is not None and match[1] >= COPY:
            units = [match[0] if k in judged else unit.units[j] for k, j in enumerate(own)]
            value = AssumedUnits(tuple(units), "likely", "").value
            seen = f"the position follows it to {100 * match[1]:.2g} % of the motion"
            found["q_ref"] = (value, seen)
            followed = np.where(rows[:, None], values * table[match[0]], np.nan)
    speed = _reference_channel("dq_ref", run, joints, kept)
    if speed is None or len(judged) < len(own):
        return found
    values = speed.values(run, kept.names)
    rows = np.isfinite(values).all(axis=1) & np.isfinite(followed).all(axis=1)
    slope = np.gradient(followed[rows], clock.seconds[rows], axis=0)
    tried = tuple(SPEED) if turning else ("m/s", "mm/s")
    fits = following_unit(_thinned(values[rows]), _thinned(slope), tried, SPEED)
    if fits is not None and (found or fits[1] >= COPY):
        whose = "the derivative of q_ref" if found else "the speed follows it"
        found["dq_ref"] = (fits[0], f"{whose} up to {100 * fits[1]:.2g} %")
    return found


def _reference_channel(
    name: str, run: Run, joints: JointMap, kept: KeptJoints
) -> ChannelColumns | None:
    """A reference that is there for all joints."""
    channel = joints.channels.get(name)
    return channel if channel is not None and set(kept.names) <= set(channel.columns) else None


def _thinned(x: np.ndarray) -> np.ndarray:
    """Means of a few neighbouring samples, in which the noise of differences averages out."""
    width = max(1, min(MEAN_OF, len(x) // MIN_ROWS))
    whole = len(x) // width * width
    return x[:whole].reshape(-1, width, x.shape[1]).mean(axis=1)


def _other_angle(unit: AssumedUnits) -> AssumedUnits:
    """Degrees for radians or the reverse, as the inverse model has it."""
    other = {"rad": "deg", "deg": "rad"}
    units = tuple(other.get(u, u) for u in unit.units)
    seen = f"{unit.seen}; torque and gravity fit twice as well or better with {units[0]}"
    return AssumedUnits(units, "likely", seen)
