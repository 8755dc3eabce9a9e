"""Offsets and loads that change with time, and friction that changes with a temperature.

Electronics that warm up, a brake that drags or a force sensor that is set to zero anew change the
offset of a torque; something that is picked up, poured out or fed changes what the flange carries.
With the instant of a jump unknown, instants all over the records are tried, and then those near the
ones that were found (see `named_causes`).

Grease thins as a gear warms up. With the temperature T of a joint logged and a reference T₀, its
viscous and Coulomb friction are

    (fv + βv (T - T₀)) dq + (fc + βc (T - T₀)) s(dq),

and fv and fc are those at T₀ once the torque of β has been taken out of the recordings.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from pivident.data.recording.recording import Recording
from pivident.dynamics.friction import friction_column
from pivident.dynamics.parameters import Parameter, standard_parameters
from pivident.dynamics.regressor import Regressor
from pivident.dynamics.robot_regressor import regressor_of
from pivident.estimation.kinematics import estimate_kinematics
from pivident.estimation.problem import Problem
from pivident.estimation.signal_recipes import RandomWalk
from pivident.foundation.common_work import once
from pivident.foundation.errors import ExperimentError
from pivident.foundation.text.numbers import format_significant
from pivident.judgement.model_errors.cause import NEGLIGIBLE, Cause, Columns, RecordMotion, on_joint
from pivident.judgement.model_errors.motion_errors import with_torques
from pivident.loop.motion.motion import Kinematics
from pivident.robot.description import Robot
from pivident.robot.joints import Joint
from pivident.signals.alignment import torque_shift

#: Instants that are tried, evenly over all records, and about each that was found on either side.
INSTANTS, NEARER = 15, 8
#: Unit of the time over which something drifts [s].
MINUTE = 60.0
#: A load at the flange: mass and first moments, the mass first, whose amplitude is the size.
LOAD = ("m", "mx", "my", "mz")
#: Kind of the change of friction with temperature, and expressions of the terms that change.
WARMTH, WARMED = "friction by temperature", ("dq", "s")
#: Distance from the mean of the record beyond which a reference is in another unit [K].
FAR = 150.0
#: Temperatures above which they are in kelvin.
KELVIN = 200.0


@dataclass(frozen=True)
class Instants:
    """Instants of jumps.

    Attributes:
        at: when, since the first record began [s].
        names: recordings, in whose time they are said.
        starts: when each of these began [s].
        apart: time between neighbours [s].
    """

    at: tuple[float, ...]
    names: tuple[str, ...]
    starts: tuple[float, ...]
    apart: float

    @classmethod
    def of(cls, kinematics: Sequence[Kinematics]) -> Instants:
        """Evenly over all records, and where each of them begins."""
        lengths = [k.recording.duration for k in kinematics]
        *starts, end = np.concatenate([[0.0], np.cumsum(lengths)]).tolist()
        even = np.linspace(0.0, end, INSTANTS + 2)[1:-1].tolist()
        at = tuple(sorted({*even, *starts[1:]}))
        names = tuple(k.recording.name for k in kinematics)
        return cls(at, names, tuple(starts), end / (INSTANTS + 1))

    def near(self, found: Sequence[float]) -> Instants:
        """Those near some of them: as many on either side as there are steps to the next one."""
        apart = self.apart / NEARER
        steps = apart * np.arange(1 - NEARER, NEARER)
        at = tuple(sorted({instant + step for instant in found for step in steps.tolist()}))
        return Instants(at, self.names, self.starts, apart)

    def text(self, instant: float) -> str:
        """``14.2 s``, or ``6.2 s of second`` where there are several recordings."""
        if len(self.starts) < 2:
            return f"{instant:.1f} s"
        number = max(int(np.searchsorted(self.starts, instant, "right")) - 1, 0)
        return f"{instant - self.starts[number]:.1f} s of {self.names[number]}"


def time_causes(robot: Robot, instants: Instants) -> Iterator[Cause]:
    """Drift and jumps of each joint's offset, and of the load at the flange of a tree.

    Args:
        robot: as described.
        instants: when something may jump.
    """
    for j, joint in enumerate(robot.joints):
        if joint.motion == "driven":
            yield from _offsets(joint, j, instants)
    if robot.constraints is None and robot.joints[-1].motion == "driven":
        yield from _loads(robot, instants)


def _offsets(joint: Joint, j: int, instants: Instants) -> Iterator[Cause]:
    """A drift of one joint's offset, and jumps."""
    name, unit = joint.name, joint.torque_unit

    def torques(motion: RecordMotion) -> np.ndarray:
        return on_joint(j, [np.ones(motion.q.shape[1])], motion)

    what = "the offset", f"the offset of {name}"
    yield _drifts("offset drift", name, what, unit, torques)
    for instant in instants.at:
        when = instants.text(instant)
        yield _jumps("offset jump", name, what, unit, torques, instant, when)


def _loads(robot: Robot, instants: Instants) -> Iterator[Cause]:
    """A drift of the load at the flange, and jumps."""
    own = {p.stem: p for p in standard_parameters(robot) if p.joint == robot.size - 1}
    torques = torques_of([own[stem] for stem in LOAD])
    name, what = robot.joint_names[-1], ("the mass at the flange", "the load at the flange")
    yield _drifts("load drift", name, what, "kg", torques, len(LOAD))
    for instant in instants.at:
        when = instants.text(instant)
        yield _jumps("load jump", name, what, "kg", torques, instant, when, len(LOAD))


def _drifts(
    kind: str, name: str, what: tuple[str, str], unit: str, torques: Columns, count: int = 1
) -> Cause:
    """Torques that grow with the time; ``what``: in the name and in the sentence."""
    return Cause(
        kind,
        name,
        f"drift of {what[0]}",
        f"{unit}/min",
        lambda motion: torques(motion) * motion.seconds / MINUTE,
        count,
        by_first=True,
        is_smooth=True,
        least_torque=NEGLIGIBLE,
        phrase=f"{what[1]} drifts by {{size}}",
    )


def _jumps(
    kind: str,
    name: str,
    what: tuple[str, str],
    unit: str,
    torques: Columns,
    instant: float,
    when: str,
    count: int = 1,
) -> Cause:
    """Torques from an instant on; ``when``: in words."""
    return Cause(
        kind,
        name,
        f"jump of {what[0]} at {when}",
        unit,
        lambda motion: torques(motion) * (motion.seconds >= instant),
        count,
        by_first=True,
        is_smooth=True,
        least_torque=NEGLIGIBLE,
        phrase=f"{what[1]} jumped by {{size}} at {when}",
        instant=instant,
    )


def torques_of(parameters: Sequence[Parameter]) -> Columns:
    """Columns of parameters: torque of each at one, shape (columns, joints, samples)."""

    @lru_cache(maxsize=1)
    def regressor(robot: Robot) -> Regressor:
        return regressor_of(robot, parameters)

    @lru_cache(maxsize=1)
    def columns(motion: RecordMotion) -> np.ndarray:
        matrix = regressor(motion.robot).matrix(motion.q.T, motion.dq.T, motion.ddq.T)
        return np.ascontiguousarray(matrix.transpose(2, 1, 0))

    return columns


def reference_temperatures(problem: Problem) -> np.ndarray:
    """Temperature of each joint that its friction belongs to, shape (joints,) [°C or K].

    Args:
        problem: with a temperature in every recording.

    Raises:
        ExperimentError: a recording has none, none changes, or the reference is in another unit
            than theirs.
    """
    every = np.concatenate([_temperature(recording) for recording in problem.recordings])
    mean = every.mean(axis=0)
    given, base = problem.reference_temperature, problem.robot.base_joints
    if not np.ptp(every[:, base:], axis=0).any():
        raise ExperimentError(
            f"the temperatures are {mean[base]:.4g} throughout, which shows no change of friction",
            advice="record from a cold start, or leave temperature out",
        ).about("identify", "temperature")
    if given is None:
        return np.asarray(mean)
    if np.abs(given - mean[base:]).max() > FAR:
        raise ExperimentError(
            f"reference_temperature is {given:g}, but the temperatures of the record are "
            f"{mean[base:].min():.4g} to {mean[base:].max():.4g} on average",
            advice="give it in the unit of the log: 25 °C are 298 K",
        ).about("identify", "reference_temperature")
    return np.full(mean.shape, float(given))


def _temperature(recording: Recording) -> np.ndarray:
    """That of a recording, refused where there is none, or no torque that would change with it."""
    recording.require_torque("the change of friction with temperature is found")
    if recording.temperature is None:
        raise ExperimentError(
            f"recording {recording.name!r} has no temperature",
            advice="name columns that all runs have, or leave this run out",
        ).about("identify", "temperature")
    return recording.temperature


def temperature_causes(problem: Problem) -> Iterator[Cause]:
    """Friction of each joint that changes with its temperature, where recordings have one."""
    if all(recording.temperature is None for recording in problem.recordings):
        return
    reference = reference_temperatures(problem)
    for j, place in enumerate(problem.robot.places):
        own = [
            p for p in problem.regressor.parameters
            if p.joint == place and p.friction is not None
            and p.friction.column.expression in WARMED
        ]  # fmt: skip
        if own:
            yield _warmth(problem, j, own, float(reference[j]))


def _warmth(problem: Problem, j: int, own: Sequence[Parameter], reference: float) -> Cause:
    """(T - T₀) times the columns of some friction parameters of one joint."""

    def torques(recording: Recording, seconds: np.ndarray, dq: np.ndarray) -> list[np.ndarray]:
        t = np.arange(recording.samples) / recording.rate
        w = np.interp(seconds, t, _temperature(recording)[:, j]) - reference
        return [w * friction_column(p.friction, dq) for p in own if p.friction is not None]

    def columns(motion: RecordMotion) -> np.ndarray:
        recording, seconds = problem.recordings[motion.number], motion.seconds - motion.start
        return on_joint(j, torques(recording, seconds, motion.dq[j]), motion)

    def correct(given: Problem, size: np.ndarray) -> Problem:
        def cooled(recording: Recording) -> np.ndarray:
            k = np.arange(recording.samples)
            late = k + torque_shift(
                recording.rate, recording.torque_timing, control_rate=recording.control_rate,
                delay=recording.delay - recording.drive_delay,
            )  # fmt: skip
            dq = np.interp(late, k, speeds_of(recording)[j])
            added = size @ torques(recording, late / recording.rate, dq)
            return np.asarray(recording.tau[:, j] - added)

        return with_torques(given, j, cooled)

    every = np.concatenate([_temperature(r)[:, j] for r in problem.recordings])
    what = f"temperature of {every.min():.3g} to {temperature_text(float(every.max()))}"
    name = problem.robot.joint_names[j]
    phrase = f"the friction of {name} changes with its temperature, {{size}}; it holds at "
    return Cause(
        WARMTH,
        name,
        what,
        "",
        columns,
        len(own),
        correct,
        parts=tuple((p.name, f"{p.unit} per K") for p in own),
        phrase=f"{phrase}{temperature_text(reference)}",
        reference=reference,
    )


def temperature_text(value: float) -> str:
    """``37.3 °C``, or ``310 K`` of temperatures that are in kelvin."""
    return f"{format_significant(value)} {'K' if value > KELVIN else '°C'}"


def speeds_of(recording: Recording) -> np.ndarray:
    """Smoothed speeds, shape (joints, samples), once for all recordings of the same positions."""

    def made() -> tuple[np.ndarray, np.ndarray]:  # with the positions, whose number is then theirs
        return recording.q, estimate_kinematics(recording, RandomWalk()).dq

    return once(("speeds", id(recording.q), recording.rate), made)[1]
