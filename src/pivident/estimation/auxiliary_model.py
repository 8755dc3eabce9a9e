"""The auxiliary model: the loop simulated with the current parameters, and its motion.

The simulation knows the reference and the law, but no measured noise; its motion is correlated
with the true one and not with the noise, which is what an instrument has to be.

The motion of the simulated loop in place of the measured, once it has forgotten its start.
"""

from __future__ import annotations

import copy
import dataclasses
from collections.abc import Sequence

import numpy as np

from pivident.data.recording.recording import Recording
from pivident.dynamics.forward import Model, make_model
from pivident.dynamics.parameters import on_fixed_base
from pivident.estimation.problem import Problem
from pivident.foundation.errors import (
    ExperimentError,
    IdentificationError,
    MassMatrixNotPositiveDefinite,
    SimulationDiverged,
)
from pivident.foundation.scratch import working_array
from pivident.foundation.threads import run_in_threads
from pivident.loop.motion.law_torque import held, known_inputs, upsampled
from pivident.loop.motion.motion import Kinematics, SimulatedMotion
from pivident.loop.simulation.closed_loop import (
    LoopSignals,
    Trajectory,
    simulate,
    simulate_blocks,
)
from pivident.loop.simulation.control_loop import Loop, with_measured_gravity
from pivident.loop.simulation.loop_kernel import TORQUE
from pivident.robot.description import Robot
from pivident.signals.cubic_spline import cubic_spline
from pivident.signals.random_walk import smooth_channels

#: How often a step may be halved before the loop is declared impossible to simulate.
HALVINGS = 6
#: Speed that a joint at rest may reach, as a share of the fastest one's: those that move shake it.
SHAKEN = 0.02
#: The start is forgotten once its trace in the torque is this share of the torque's standard
#: deviation.
FORGOTTEN = 1e-4


class AuxiliaryModel:
    """Simulates all recordings of a problem for given parameters.

    Args:
        problem: robot, recordings and loop.
        differences: take dq and ddq from differences of q, as the smoother's. With a torque that
            is held over each period the acceleration has no value at an instant; this is its mean
            over the two periods that adjoin it.
        kinematics: motions already smoothed at full rate, one per recording; None: smooth here.
        torque: whether the torque is kept with the motion; estimators do without.
    """

    def __init__(
        self,
        problem: Problem,
        differences: bool,
        kinematics: Sequence[Kinematics] | None = None,
        torque: bool = True,
    ) -> None:
        if problem.loop is None:
            raise ExperimentError(
                "IV and PIV need the control loop for their instruments: give the controller and "
                "its gains ([controller] in an experiment file), or use a least-squares method"
            )
        if problem.robot.base_motion == "measured":
            raise ExperimentError(
                f"robot {problem.robot.name!r} has a floating base, which the simulated loop does "
                "not handle",
                advice='leave out instruments = "loop", other instruments are made from the record',
            )
        self.problem = problem
        self.differences = differences
        self.torque = torque
        self.simulated = False  # whether any parameters could be simulated
        self.loop = loop = problem.loop
        self.base = problem.robot.base_joints  # which stand still and are not simulated
        self.robot = problem.robot.on_fixed_base
        self.chosen, self.parameters = on_fixed_base(problem.robot, problem.regressor.parameters)
        self.recordings = [recording.behind(self.base) for recording in problem.recordings]
        self.controller = with_measured_gravity(
            loop.controller, self.robot, loop.drive_gain, loop.feed_forward
        )
        self.signals = []
        for k, recording in enumerate(self.recordings):
            if kinematics is None:
                smoothed = smooth_channels(recording.q, recording.rate)
                motion = smoothed.q, smoothed.dq
            else:
                motion = kinematics[k].q[self.base :].T, kinematics[k].dq[self.base :].T
            self.signals.append(loop_signals(self.robot, self.loop, recording, *motion))

    def simulate(self, theta: np.ndarray, samples: int | None = None) -> list[SimulatedMotion]:
        """Simulate every recording.

        Args:
            theta: the problem's parameters, shape (parameters,).
            samples: of each recording only so many from its beginning; None: all.

        Raises:
            SimulationDiverged: the loop leaves its reference.
            MassMatrixNotPositiveDefinite: M(q) is indefinite on the way.
        """
        model = make_model(self.robot, self.parameters, theta[self.chosen], clip=True)
        motions: list[SimulatedMotion | None] = [None] * len(self.signals)

        def run(k: int) -> None:
            whole = self.recordings[k].samples
            motions[k] = self._motion(k, model, whole if samples is None else min(samples, whole))

        run_in_threads(run, range(len(self.signals)))
        return [motion for motion in motions if motion is not None]

    def _motion(self, k: int, model: Model, samples: int) -> SimulatedMotion:
        """The motion of one recording; the channels of the simulation are never held whole."""
        recording, (signals, start) = self.recordings[k], self.signals[k]
        controller, names = self.controller, self.robot.joint_names
        ratio = signals.rate / recording.rate
        step = round(ratio)
        if step < 1 or abs(ratio - step) > 1e-9:
            made = simulate(model, controller, signals, names, start)
            return self._resampled(made, recording, samples)
        kept = working_array((len(self._channels), recording.joints, samples))
        for span, channels, _ in simulate_blocks(model, controller, signals, names, start):
            first = -span.start % step  # of the stretch's samples, the first that was recorded
            begin = (span.start + first) // step
            for target, channel in zip(kept, self._channels, strict=True):
                chosen = channels[channel, first::step][: samples - begin]
                target[:, begin : begin + len(chosen)] = chosen.T
            if span.stop > (samples - 1) * step:
                break
        return self._as_motion(kept, recording.rate)

    def _resampled(self, made: Trajectory, recording: Recording, samples: int) -> SimulatedMotion:
        """A motion of a control rate that is no multiple of the record's, by cubic splines."""
        channels = (made.q, made.dq, made.ddq, made.tau)
        wanted = np.arange(samples) / recording.rate
        t = np.arange(len(made.q)) / made.rate
        kept = working_array((len(self._channels), recording.joints, samples))
        for target, channel in zip(kept, self._channels, strict=True):
            target[:] = cubic_spline(t, channels[channel])(wanted).T
        return self._as_motion(kept, recording.rate)

    def _as_motion(self, kept: np.ndarray, rate: float) -> SimulatedMotion:
        """The kept channels as a motion, with a base that stands still."""
        if self.base:
            kept = np.pad(kept, ((0, 0), (self.base, 0), (0, 0)))
        tau = kept[-1] if self.torque else None
        return SimulatedMotion(kept[0], rate, None if self.differences else kept[1:3], tau)

    @property
    def _channels(self) -> tuple[int, ...]:
        """Channels of the simulation that are kept: q, dq and ddq if not by differences, tau."""
        motion = (0,) if self.differences else (0, 1, 2)
        return (*motion, TORQUE) if self.torque else motion

    def simulate_or_halve(
        self, previous: np.ndarray | None, theta: np.ndarray
    ) -> tuple[list[SimulatedMotion], np.ndarray, int]:
        """Simulate, going back half the step as long as the loop cannot be simulated.

        Args:
            previous: parameters of the last successful simulation, shape (parameters,); None at
                the start.
            theta: parameters wanted, shape (parameters,).

        Returns:
            Motions, the parameters they were made with, number of halvings.

        Raises:
            SimulationDiverged: even the start, or the smallest step, cannot be simulated.
            MassMatrixNotPositiveDefinite: likewise.
        """
        step = theta
        for halvings in range(HALVINGS + 1):
            try:
                motions = self.simulate(step)
            except (SimulationDiverged, MassMatrixNotPositiveDefinite) as error:
                if previous is None or halvings == HALVINGS:
                    # later than at the start the estimate is the cause, not what was given
                    error.problem, error.from_start = self.problem, not self.simulated
                    raise
                step = previous + 0.5 * (step - previous)
            else:
                self.simulated = True
                return motions, step, halvings
        raise AssertionError("unreachable")


def mean_until_next(x: np.ndarray, early: float) -> np.ndarray:
    """Mean of a signal between each sample and the next, some samples early, shape like ``x``."""
    count = np.arange(len(x), dtype=float)
    middle = np.minimum(count + 0.5 + early, len(x) - 1.0)
    return np.stack([np.interp(middle, count, own) for own in x.T], axis=1)


def loop_signals(
    robot: Robot, loop: Loop, recording: Recording, q: np.ndarray, dq: np.ndarray
) -> tuple[LoopSignals, tuple[np.ndarray, np.ndarray]]:
    """What drives the simulated loop of one recording, and its initial positions and speeds.

    ``q``: its smoothed positions, shape (samples, joints) [rad or m].
    """
    n = recording.joints
    q_ref: np.ndarray = q
    dq_ref: np.ndarray | None = dq
    if loop.reference == "recorded" and recording.q_ref is None:
        raise ExperimentError(
            f"recording {recording.name!r} has no reference q_ref",
            advice="map its column, or set "
            'reference = "smoothed" to use the smoothed measurement in its place',
        )
    if loop.reference == "recorded" and recording.q_ref is not None:
        q_ref, dq_ref = recording.q_ref, recording.dq_ref
    inputs = known_inputs(robot, loop, recording, q_ref, dq_ref)
    gain = np.broadcast_to(np.asarray(loop.drive_gain, float), (n,)).copy()
    if recording.wrench_torque is not None:  # it acts beside the command, whose mean it joins
        pushed = mean_until_next(recording.wrench_torque, recording.drive_delay * recording.rate)
        inputs = pushed / gain + (0.0 if inputs is None else inputs)
    tracking = np.abs(recording.q - q_ref).max(axis=0)
    reach = np.ptp(q_ref, axis=0)
    speed = np.abs(dq).max(axis=0)
    rate = recording.control_rate
    signals = LoopSignals(
        rate=rate,
        q_ref=upsampled(q_ref, recording.rate, rate),
        dq_ref=None if dq_ref is None else upsampled(dq_ref, recording.rate, rate),
        inputs=None if inputs is None else held(inputs, recording.rate, rate),
        noise=None,
        drive_gain=gain,
        limit=np.broadcast_to(np.asarray(loop.limit, float), (n,)).copy(),
        bound=np.maximum(10.0 * tracking, np.minimum(0.5, 0.5 * reach + 1e-3)),
        speed_bound=5.0 * np.maximum(speed, SHAKEN * speed.max()) + 1e-3,
        drive_delay=recording.drive_delay,
    )
    return signals, (q[0].copy(), dq[0].copy())


def simulated_kinematics(kinematics: Kinematics, motion: SimulatedMotion, start: int) -> Kinematics:
    """The simulated motion in place of the smoothed one, with the measured torque."""
    unsmoothed = np.full(kinematics.f50.shape, np.nan)
    return dataclasses.replace(
        kinematics, q=motion.q, dq=motion.dq, ddq=motion.ddq, start=start, f50=unsmoothed
    )


def settled_starts(
    auxiliary: AuxiliaryModel,
    theta: np.ndarray,
    motions: Sequence[SimulatedMotion],
    kinematics: Sequence[Kinematics],
) -> list[int]:
    """First sample of each recording at which the simulated loop has forgotten its start.

    The loop is simulated once more from another start, at rest on its reference. What differs
    comes from the start.
    """
    other = copy.copy(auxiliary)
    other.signals = [(s, (s.q_ref[0].copy(), np.zeros_like(s.q_ref[0]))) for s, _ in other.signals]
    starts = []
    for here, there, kin in zip(motions, other.simulate(theta), kinematics, strict=True):
        assert here.tau is not None and there.tau is not None
        trace = np.abs(here.tau - there.tau) > FORGOTTEN * here.tau.std(axis=1, keepdims=True)
        seen = np.flatnonzero(trace.any(axis=0))
        start = max(kin.start, int(seen[-1]) + 1 if seen.size else 0)
        if start > 0.5 * (kin.start + kin.stop):
            raise IdentificationError(
                f"in recording {kin.recording.name!r} the simulated loop still shows where it "
                f"started after {start / kin.recording.rate:.2g} s, more than half the record",
                advice="the gains are soft or the record is short. Use piv, or a longer record",
            )
        starts.append(start)
    return starts
