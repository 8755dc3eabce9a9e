"""A problem with a repair of its log, robot or parameters, as if its file had been changed.

What a repair does to a file, see `pivident.experiment.repairs`, it does here to the samples that
were read: a judge can try it without reading the log again. Samples are those of the joint side.

What was wrong where a repair helps, in words.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import singledispatch
from typing import Any

import numpy as np

from pivident.data.logs.log import factors_of, gains_of, sides_of
from pivident.data.recording.recording import Recording
from pivident.estimation.problem import Problem
from pivident.foundation.errors import ExperimentError
from pivident.foundation.text.numbers import format_significant
from pivident.foundation.text.repair import (
    CALLED,
    RECORDING,
    Change,
    Edit,
    Multiplied,
    NotRead,
    Reordered,
    Repair,
    Retimed,
    Reversed,
    Shifted,
)
from pivident.foundation.text.sentences import listed
from pivident.robot.description import Robot

#: Channels of a joint's position and of its derivatives, each by what it belongs to.
POSITIONS, DERIVATIVES = ("q", "q_ref"), ("dq", "ddq", "dq_ref", "ddq_ref")

#: Channels by name, each of shape (samples, joints).
Channels = Mapping[str, np.ndarray]


def repaired(problem: Problem, repair: Repair) -> Problem:
    """The problem with a repair.

    Args:
        problem: what is given.
        repair: of its recordings, all of them, of its robot or of its parameters.

    Returns:
        The problem as it would be read after the repair. It has no control loop, whose reference
        and gains belong to the log as it was.

    Raises:
        ExperimentError: an edit that only reading the log again can carry out.
        PividentError: the repair leaves nothing that can be identified.
    """
    problem = replace(problem, loop=None)
    for edit in repair.edits:
        problem = _after(edit, problem)
    return problem


def channels_after(
    edit: Change, channels: Channels, joints: Sequence[str], zeros: np.ndarray | float = 0.0
) -> Channels:
    """Channels of a recording after an edit of its columns, its units or its zeros.

    Args:
        edit: what is changed.
        channels: samples by channel, each of shape (samples, joints); derivatives of the positions
            change with them.
        joints: names of the joints.
        zeros: what was added to the logged positions, shape (joints,) [rad or m]: a sign or a
            factor is that of the log.

    Raises:
        ExperimentError: it changes something else.
    """
    match edit:
        case Reversed(channel=channel, joints=names):
            factors = {name: -1.0 for name in names}
        case Multiplied(channel=channel, factors=pairs):
            factors = dict(pairs)
        case Reordered(channel=channel, order=order):
            picked = _concerned(channel, channels)
            return {
                c: _logged(c, x, zeros, lambda x: x[:, list(order)]) if c in picked else x
                for c, x in channels.items()
            }
        case Shifted(offsets=offsets):
            added = np.array([dict(offsets).get(name, 0.0) for name in joints])
            return {c: x + added if c in POSITIONS else x for c, x in channels.items()}
        case _:
            raise _not_here(edit)
    worth = np.array([factors.get(name, 1.0) for name in joints])
    picked = _concerned(channel, channels)
    return {
        c: _logged(c, x, zeros, lambda x: x * worth) if c in picked else x
        for c, x in channels.items()
    }


def _logged(
    channel: str,
    x: np.ndarray,
    zeros: np.ndarray | float,
    change: Callable[[np.ndarray], np.ndarray],
) -> np.ndarray:
    """A change of the samples before zeros were added to positions."""
    return change(x - zeros) + zeros if channel in POSITIONS else change(x)


def zeros_of(recording: Recording) -> np.ndarray:
    """What was added to the logged positions, shape (joints,) [rad or m]."""
    stated = recording.reading.get("position_offset")
    return np.zeros(len(recording.joint_names)) if stated is None else np.array(stated, float)


def _concerned(channel: str, channels: Channels) -> set[str]:
    """Channels that change with one; the logged speed has columns and a unit of its own."""
    if not channel:
        return set(channels)
    return {channel, *(("dq", "ddq") if channel == "q" and "ddq" in channels else ())}


@singledispatch
def _after(edit: Change, problem: Problem) -> Problem:
    """One edit; those of channels change all recordings alike."""

    def changed(recording: Recording) -> Recording:
        names = ("q", "tau", "q_ref", "dq_ref", "ddq_ref", "dq")
        read = {c: x for c in names if (x := getattr(recording, c)) is not None}
        after: dict[str, Any] = {
            **channels_after(edit, read, recording.joint_names, zeros_of(recording))
        }
        return replace(recording, **after)

    return replace(problem, recordings=tuple(map(changed, problem.recordings)))


@_after.register
def _reordered(edit: Reordered, problem: Problem) -> Problem:
    """Columns in another order, in the units of their new places."""
    order = list(edit.order)

    def changed(recording: Recording) -> Recording:
        worth = worth_of_units(problem.robot, recording)
        worth |= {c: worth["q"] for c in ("q_ref", "dq_ref", "ddq_ref", "dq")}
        picked = [edit.channel] if edit.channel else [*worth]
        read = {c: x for c in picked if (x := getattr(recording, c)) is not None}
        factor, zeros = {c: worth[c] / worth[c][order] for c in read}, zeros_of(recording)

        def moved(c: str, x: np.ndarray) -> np.ndarray:
            return _logged(c, x, zeros, lambda x: x[:, order] * factor[c])

        after: dict[str, Any] = {c: moved(c, x) for c, x in read.items()}
        return replace(recording, **after)

    return replace(problem, recordings=tuple(map(changed, problem.recordings)))


@_after.register
def _retimed(edit: Retimed, problem: Problem) -> Problem:
    """Rates and times of a clock that runs otherwise."""
    return replace(
        problem,
        recordings=tuple(
            replace(
                r,
                rate=r.rate / edit.factor,
                control_rate=r.control_rate / edit.factor,
                start_time=r.start_time * edit.factor,
            )
            for r in problem.recordings
        ),
    )


@_after.register
def _not_read(edit: NotRead, problem: Problem) -> Problem:
    """A channel that is left out."""
    if edit.channel in ("q", "tau"):
        raise _not_here(edit)
    none: dict[str, Any] = {edit.channel: None}
    return replace(problem, recordings=tuple(replace(r, **none) for r in problem.recordings))


@_after.register
def _edit(edit: Edit, problem: Problem) -> Problem:
    """Keys that a problem holds as they are."""
    value: Any = edit.value
    match edit.place:
        case ("robot", "gravity"):
            return replace(problem, robot=problem.robot.with_gravity(np.array(value, float)))
        case ("identify", "parameters"):
            return problem.estimating(value)
        case (*table, "part") if table[:1] == list(RECORDING):
            return replace(problem, recordings=tuple(r.slice(*value) for r in problem.recordings))
        case (*table, "delay" | "drive_delay" | "torque_timing" as key) if table[:1] == list(
            RECORDING
        ):
            changed: dict[str, Any] = {key: value or 0.0}
            recordings = tuple(replace(r, **changed) for r in problem.recordings)
            return replace(problem, recordings=recordings)
    raise _not_here(edit)


def _not_here(edit: Change) -> ExperimentError:
    return ExperimentError(
        f"{type(edit).__name__} cannot be tried on samples that were read",
        advice="change the file and read the log again",
    )


def worth_of_units(robot: Robot, recording: Recording) -> dict[str, np.ndarray]:
    """What a unit of the log is worth at each joint's place, of positions and torques.

    Columns that are exchanged take the units and gains of their new places.
    """
    units, sides = recording.reading.get("units") or {}, sides_of(recording.reading.get("side"))
    turns = np.abs(np.diag(robot.transmission.reduction))
    turns = np.where(turns > 0.0, turns, 1.0)  # a motor may turn another joint alone
    worth = {}
    for channel, of_gear in (("q", 1.0 / turns), ("tau", turns)):
        spec = units.get(channel)
        listed = list(spec) if isinstance(spec, (list, tuple)) else [spec] * robot.size
        factors, commands = factors_of(channel, listed)
        gains, _ = gains_of(commands, robot.transmission)
        worth[channel] = np.abs(factors * gains * (of_gear if sides[channel] == "motor" else 1.0))
    return worth


def cause_of(repair: Repair, joints: Sequence[str]) -> str:
    """What was wrong, one sentence for each edit; empty where its edits do not say.

    Args:
        repair: which helps.
        joints: names of the robot's joints, in order.
    """
    return " ".join(filter(None, (_of(edit, joints) for edit in repair.edits)))


def _of(edit: Change, names: Sequence[str]) -> str:
    """One edit."""
    match edit:
        case Reversed(channel="", joints=joints):
            return f"{listed(joints)} turn{'s' * (len(joints) == 1)} the other way than described."
        case Reversed(channel=channel, joints=joints):
            return f"The {CALLED.get(channel, channel)} of {listed(joints)} has the other sign."
        case Multiplied(channel="q", factors=factors):
            return " ".join(_unit(*pair) for pair in factors)
        case Multiplied(channel=channel, factors=factors):
            said = [f"of {j} is {format_significant(1.0 / f)} times as large" for j, f in factors]
            return f"The logged {CALLED.get(channel, channel)} {listed(said)} as it should be."
        case Reordered(channel=channel, order=order):
            whose = CALLED.get(channel, "column") if channel else "column"
            moved = [names[k] for k, own in enumerate(order) if own != k]
            return f"The {whose}s of {' and '.join(moved)} are exchanged."
        case Shifted(offsets=offsets):
            said = [f"of {j} is off by {math.degrees(-x):.4g}°" for j, x in offsets]
            return f"The zero position {listed(said)}."
        case Retimed(factor=factor):
            times = factor if factor > 1.0 else 1.0 / factor
            faster = "fast" if factor > 1.0 else "slowly"
            return f"The clock runs {format_significant(times)} times as {faster} as it should."
        case NotRead(channel=channel):
            return f"{channel} is not what its name says."
        case Edit(place=("robot", "gravity"), value=value) if not any(value):
            return "The torques hold no gravity: the drives have taken it out."
        case Edit(place=("robot", "gravity"), value=value):
            return f"Gravity points along {_axis(value)} of the base."
        case Edit(place=(*_, "delay"), value=value):
            late = 1e3 * (value or 0.0)
            side = "before" if late < 0.0 else "after"
            return f"The torques were logged {abs(late):.3g} ms {side} the positions."
        case Edit(place=(*_, "torque_timing"), value=value):
            return f"The torques are {value}, see torque_timing."
    return ""


def _unit(joint: str, factor: float) -> str:
    """Degrees among radians, or a factor."""
    if math.isclose(factor, math.pi / 180.0, rel_tol=1e-3):
        return f"The position of {joint} is in degrees."
    if math.isclose(factor, 180.0 / math.pi, rel_tol=1e-3):
        return f"The position of {joint} is in radians."
    return f"The position of {joint} is {format_significant(1.0 / factor)} times as large."


def _axis(gravity: Sequence[float]) -> str:
    """``-z``, or the components."""
    size = math.hypot(*gravity)
    for axis, x in zip("xyz", gravity, strict=True):
        if abs(x) > 0.99 * size:
            return f"{'+' if x > 0 else '-'}{axis}"
    return str(list(gravity))
