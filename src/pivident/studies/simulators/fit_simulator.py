"""Fit the joints of a simulator to positions alone: no torque, no acceleration.

The control loop is simulated with the reference of the record and known gains, and what it gives is
compared with the encoders: an output error (``estimation.output_error``). Gains in joint torque
give the scale that a torque would; without them only ratios could be found.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pivident.data.recording.joint_order import in_order_of
from pivident.data.recording.recording import Recording
from pivident.dynamics.parameters import standard_parameters
from pivident.estimation.auxiliary_model import loop_signals
from pivident.estimation.output_error.record_stretches import Stretch
from pivident.estimation.output_error.simulation_fit import SimulationFit
from pivident.foundation.distributions import student
from pivident.foundation.errors import ExperimentError
from pivident.foundation.threads import run_in_threads
from pivident.loop.simulation.closed_loop import LoopSignals
from pivident.loop.simulation.control_loop import Loop, nominal_inertia, with_measured_gravity
from pivident.loop.simulation.controllers import Controller
from pivident.loop.simulation.direction import ParametrisedLoop
from pivident.robot.description import Robot
from pivident.robot.refusals import without_loops, without_wrenches
from pivident.signals.random_walk import smooth_channels
from pivident.studies.simulators.branches import (
    BranchEstimate,
    SharedDelay,
    branch_of,
    branches,
    can_be_divided,
    law_of,
    signals_of,
    with_shared_delay,
)
from pivident.studies.simulators.joint_quantities import (
    DEFAULT_QUANTITIES,
    JointQuantity,
    check_quantities,
    joint_quantities,
    simulator_robot,
    start_values,
)
from pivident.studies.simulators.search import searched
from pivident.studies.simulators.simulator_fit import LEVEL, FittedValue, SimulatorFit

#: Time after which a position loop has forgotten where it started, and is compared [s].
WARM_UP = 0.5

#: Where the search for the delay starts if none is given, in periods of the control loop.
DELAY_START = 1.0


#: Relative error of a rate that comes from stamps, at most.
MAX_OFF = 1e-4


@dataclass(frozen=True, eq=False)
class _Drive:
    """One recording: what drives the loop, and what was measured."""

    name: str
    signals: LoopSignals
    q: np.ndarray
    speed: np.ndarray  # at the first sample
    step: int
    start_time: float


def fit_simulator(
    robot: Robot,
    loop: Loop,
    recordings: Recording | Sequence[Recording],
    free: Sequence[str] = DEFAULT_QUANTITIES,
    *,
    warm_up: float = WARM_UP,
    progress: Callable[[str], None] | None = None,
) -> SimulatorFit:
    """Fit armature, damping, dry friction, encoder bias, delay and gains to measured positions.

    Torques of the recordings are not used. The links keep the inertias of the description.

    Args:
        robot: the description; its nominal rotor inertias and friction are where the search
            starts.
        loop: control law, whose gains times ``drive_gain`` are joint torques, and a recorded
            reference.
        recordings: one or several; the control rate is a whole multiple of their rate.
        free: what is fitted, some of `QUANTITIES`.
        warm_up: time at the beginning of each recording that is simulated, but not compared [s].
        progress: called with one line after each pass.

    Returns:
        Values with standard errors and intervals.

    Raises:
        ExperimentError: no reference, a law without gains, unknown quantities, a control rate that
            is no multiple of the recorded one.
        SimulationDiverged: the loop is unstable wherever the search starts; names the joint.
        RankDeficientRegressor: the record does not determine some quantities; names them.
        RobotDescriptionError: a robot with closed loops.
    """
    without_wrenches(robot, "the fit of a simulator")
    without_loops(robot, "the fit of a simulator")
    runs = [recordings] if isinstance(recordings, Recording) else list(recordings)
    runs = [in_order_of(robot, recording) for recording in runs]
    check_quantities(free)
    say = progress or (lambda line: None)
    machine = simulator_robot(robot)
    controller = with_measured_gravity(loop.controller, machine, loop.drive_gain, loop.feed_forward)
    drives = [_drive(machine, loop, run, "delay" in free) for run in runs]
    parts = branches(machine) if can_be_divided(controller) else [tuple(range(machine.size))]
    inertia, torque, speed = _start(machine, loop, controller, runs, runs[0].q.mean(axis=0))
    fits: list[SimulationFit | None] = [None] * len(parts)
    offsets: list[np.ndarray] = [np.zeros(0)] * len(parts)
    sought: list[list[JointQuantity]] = []
    stretches: list[list[Stretch]] = []
    for joints in parts:
        own, at = branch_of(machine, joints), list(joints)
        sought.append(joint_quantities(own, free))
        law = law_of(controller, joints, machine.size)
        theta = start_values(own, free, inertia[at], torque[at], speed[at])
        stretches.append([_stretch(own, theta, law, joints, d, warm_up) for d in drives])

    def work(b: int) -> None:
        label = f"branch {b + 1} of {len(parts)}: " if len(parts) > 1 else ""
        fits[b], offsets[b] = searched(stretches[b], sought[b], lambda s: say(label + s))

    run_in_threads(work, range(len(parts)))
    found = [fit for fit in fits if fit is not None]
    estimates = [_estimate(*own) for own in zip(found, sought, offsets, strict=True)]
    shared = with_shared_delay(estimates)
    return _result(
        machine, loop, controller, runs, parts, sought, stretches, found, shared, warm_up
    )


def _drive(robot: Robot, loop: Loop, recording: Recording, sought: bool) -> _Drive:
    """What drives the simulated loop of one recording."""
    if loop.reference != "recorded" or recording.q_ref is None:
        raise ExperimentError(
            f"recording {recording.name!r} has no reference: a simulator is driven by what the "
            "robot was commanded",
            advice="map the column of q_ref under [recording]",
        )
    recording, step = in_whole_periods(recording)
    speed = np.gradient(recording.q, axis=0) * recording.rate
    signals, _ = loop_signals(robot, loop, recording, recording.q, speed)
    if sought and signals.drive_delay == 0.0:
        signals = replace(signals, drive_delay=DELAY_START / signals.rate)
    begin = smooth_channels(recording.q, recording.rate).dq[0]
    return _Drive(recording.name, signals, recording.q, begin, step, recording.start_time)


def in_whole_periods(recording: Recording) -> tuple[Recording, int]:
    """A recording whose control rate is a whole multiple of its own, and the multiple.

    Raises:
        ExperimentError: it is none, by more than the stamps of a log are off.
    """
    ratio = recording.control_rate / recording.rate
    step = round(ratio)
    if step < 1 or abs(ratio - step) > MAX_OFF * step:
        raise ExperimentError(
            f"recording {recording.name!r}: the control rate {recording.control_rate:g} Hz is no "
            f"whole multiple of the recorded {recording.rate:g} Hz",
            advice="give control_rate under [recording], or resample the log",
        )
    return replace(recording, control_rate=step * recording.rate), step


def _stretch(
    robot: Robot,
    theta: np.ndarray,
    law: Controller,
    joints: Sequence[int],
    drive: _Drive,
    warm_up: float,
) -> Stretch:
    """One recording of a branch beside its loop."""
    q = np.ascontiguousarray(drive.q[:, list(joints)])
    loop = ParametrisedLoop(
        robot,
        standard_parameters(robot),
        theta,
        law,
        signals_of(drive.signals, joints),
        (q[0].copy(), drive.speed[list(joints)]),
    )
    first = round(warm_up * drive.signals.rate / drive.step)
    if not 0 <= first < len(q) // 2:
        raise ExperimentError(
            f"recording {drive.name!r} lasts {len(q) * drive.step / drive.signals.rate:g} s, "
            f"which is too short for a warm-up of {warm_up:g} s",
            advice="record a longer motion",
        )
    moving = np.ones(q.shape, dtype=bool)
    return Stretch(drive.name, loop, q, None, drive.step, 0, moving, drive.start_time, None, first)


def _start(
    robot: Robot,
    loop: Loop,
    controller: Controller,
    runs: Sequence[Recording],
    posture: np.ndarray,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Inertia of each joint, torque that its law commands, and speed: the scales of the search."""
    kp, _ = joint_gains(controller, loop, robot.size)
    if not (np.nan_to_num(kp) > 0.0).all():
        weak = robot.joint_names[int(np.argmin(np.nan_to_num(kp)))]
        raise ExperimentError(
            f"the position gain of joint {weak!r} is zero or not known, and the scale of all "
            "torques comes from the gains",
            advice="give kp under [controller] in joint torque per rad (m), or with drive_gain",
        )
    error = np.concatenate([r.q_ref - r.q for r in runs if r.q_ref is not None])
    speed = np.concatenate([np.gradient(r.q, axis=0) * r.rate for r in runs])
    return (
        nominal_inertia(robot, posture),
        kp * np.sqrt(np.mean(error**2, axis=0)),
        np.sqrt(np.mean(speed**2, axis=0)),
    )


def joint_gains(controller: Controller, loop: Loop, joints: int) -> tuple[np.ndarray, np.ndarray]:
    """Position and speed gains of a law in joint torque, each (joints,); NaN where it has none.

    A cascade has kp kv and kv.
    """
    law = getattr(controller, "feedback", controller)
    scale = np.broadcast_to(np.asarray(loop.drive_gain, float), joints)

    def gain(name: str) -> np.ndarray:
        value = getattr(law, name, None)
        return (
            np.full(joints, np.nan)
            if value is None
            else np.broadcast_to(np.asarray(value, float), joints)
        )

    kp, kv = gain("kp"), gain("kv")
    if np.isfinite(kv).all():
        return scale * kp * kv, scale * kv
    return scale * kp, scale * gain("kd")


def _estimate(
    fit: SimulationFit, sought: Sequence[JointQuantity], offsets: np.ndarray
) -> BranchEstimate:
    """Values and covariance of a branch; what is held or at a bound has no covariance."""
    fixed = np.flatnonzero(fit.held | fit.bound)
    covariance = fit.covariance.copy()
    covariance[fixed, :] = covariance[:, fixed] = 0.0
    delay = [k for k, own in enumerate(sought) if own.quantity == "delay"]
    return BranchEstimate(fit.values + offsets, covariance, delay[0] if delay else None)


def _result(
    robot: Robot,
    loop: Loop,
    controller: Controller,
    runs: Sequence[Recording],
    parts: Sequence[Sequence[int]],
    sought: Sequence[Sequence[JointQuantity]],
    stretches: Sequence[Sequence[Stretch]],
    fits: Sequence[SimulationFit],
    shared: SharedDelay,
    warm_up: float,
) -> SimulatorFit:
    """Everything in the order of the robot's joints."""
    kp, kd = (gain.copy() for gain in joint_gains(controller, loop, robot.size))
    rms, values = np.zeros(robot.size), {}
    scale = np.broadcast_to(np.asarray(loop.drive_gain, float), robot.size)
    for joints, quantities, begin, fit, own in zip(
        parts, sought, stretches, fits, shared.branches, strict=True
    ):
        left = np.concatenate([e[0] for e in fit.errors], axis=1)
        used = np.concatenate([m.used[0] for m in fit.made], axis=1)
        for k, j in enumerate(joints):
            rms[j] = np.sqrt(np.mean(left[k][used[k]] ** 2))
        for k, quantity in enumerate(quantities):
            one = _fitted(quantity, begin[0], fit, own, k)
            gains = {"kp": kp, "kd": kd}.get(quantity.quantity)
            if gains is not None:
                j = robot.joint_names.index(quantity.joint)
                one = _scaled(one, float(scale[j]))
                gains[j] = one.value
            values[quantity.quantity, quantity.joint] = one
    order = joint_quantities(robot, [quantity for quantity, _ in values])
    return SimulatorFit(
        robot=robot,
        values=tuple(values[own.quantity, own.joint] for own in order),
        kp=kp,
        kd=kd,
        rms=rms,
        converged=all(fit.converged for fit in fits),
        passes=max(len(fit.history) for fit in fits),
        delay_p_value=shared.p_value,
        recordings=tuple(run.name for run in runs),
        samples=sum(run.samples - round(warm_up * run.rate) for run in runs),
        control_rate=runs[0].control_rate,
    )


def _fitted(
    quantity: JointQuantity, begin: Stretch, fit: SimulationFit, own: BranchEstimate, k: int
) -> FittedValue:
    """One value with its interval, by Student's distribution of the windows behind it."""
    value, variance, note = float(own.values[k]), float(own.covariance[k, k]), ""
    std = float(np.sqrt(variance)) if variance > 0.0 else float("nan")
    free = np.flatnonzero(~fit.held & ~fit.bound)
    half = float("nan")
    if variance > 0.0:
        freedom = fit.windows.degrees_of_freedom[int(np.searchsorted(free, k))]
        half = float(student.ppf(0.5 + LEVEL / 2.0, max(float(freedom), 1.0)) * std)
    elif fit.held[k]:
        note = "the record does not determine it; the value is that of the start"
    elif fit.bound[k]:
        note = (
            "it lies at its bound, which is as far as it may go"
            if value != 0.0
            else "the record shows none, and less than zero there is not"
        )
    start = float(begin.loop.value(quantity.unknown.direction))
    unknown = quantity.unknown
    return FittedValue(
        quantity.quantity, quantity.joint, unknown.unit, value, std, value - half, value + half,
        start, note,
    )  # fmt: skip


def _scaled(one: FittedValue, scale: float) -> FittedValue:
    """A gain of the law in joint torque."""
    low, high = sorted((scale * one.low, scale * one.high))
    return replace(
        one, value=scale * one.value, std=abs(scale) * one.std, low=low, high=high,
        start=scale * one.start,
    )  # fmt: skip


def fitted_controller(fit: SimulatorFit, controller: Controller, loop: Loop) -> Controller:
    """The law with the gains that were fitted."""
    scale = np.broadcast_to(np.asarray(loop.drive_gain, float), fit.robot.size)
    for name in ("kp", "kd"):
        found = fit.of(name)
        if found:
            gains = np.array([found[j].value for j in fit.robot.joint_names]) / scale
            controller = replace(controller, **{name: gains})  # type: ignore[type-var]
    return controller
