"""Replay: the loop simulated with all that a fit found of it, beside what the machine did.

A closed-loop simulation is given the reference, the control law and the known inputs, no measured
position after the first and no torque. A recording is simulated from its beginning to the end of
what is scored, since a law with memory cannot be started in the middle.

Of a simulation that was fitted the error on motion that was not is that of the positions,

    rms(q_s - q) of each joint

A closed loop is given reference and law, an open one the recorded torques and, at the first sample
of each stretch, the smoothed position and speed. Loop parameters that were identified with the
model have their estimated values.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pivident.data.recording.recording import Recording
from pivident.estimation.auxiliary_model import AuxiliaryModel, mean_until_next
from pivident.estimation.identification import Identification
from pivident.estimation.output_error.loop_unknowns import loop_unknowns, with_values
from pivident.estimation.output_error.record_stretches import closed_stretches, open_stretches
from pivident.estimation.problem import Problem, position_units, torque_units
from pivident.judgement.validation.held_out.prediction import Judge, ReplayError, SimulationError
from pivident.loop.motion.motion import Kinematics, SimulatedMotion
from pivident.loop.simulation.closed_loop import Trajectory, simulate
from pivident.loop.simulation.direction import ParametrisedLoop
from pivident.signals.cubic_spline import cubic_spline


class Replay:
    """The loop of one recording, simulated with any estimate of a problem's parameters."""

    def __init__(self, problem: Problem, judge: Judge) -> None:
        self.problem = replace(problem, recordings=(judge.recording,))
        self.recording, self.kinematics = judge.recording, judge.kinematics
        self.auxiliary = AuxiliaryModel(
            self.problem, differences=False, kinematics=[judge.kinematics]
        )

    def simulate(self, found: Identification, samples: int | None = None) -> SimulatedMotion:
        """So many samples from the beginning, time last; None: the whole recording.

        Positions are those that encoders with the offsets of a fit would show.
        """
        if has_own_loop(found):
            whole = self.recording.samples if samples is None else samples
            return closed_motion(self.problem, self.kinematics, found, whole)
        return self.auxiliary.simulate(found.theta, samples)[0]

    def score(self, found: Identification, spans: Sequence[slice]) -> list[ReplayError]:
        """Errors of an estimate on stretches of the recording."""
        ends = [span.indices(self.recording.samples)[1] for span in spans]
        delay = drive_delay(found, self.recording.drive_delay)
        ahead = int(np.ceil(delay * self.recording.rate)) + 1
        motion = self.simulate(found, max(ends) + ahead)
        assert motion.tau is not None
        measured = slice(0, motion.tau.shape[1])
        recording, tau = self.recording, motion.tau.T
        if recording.wrench_torque is not None:
            early = delay * recording.rate
            tau = tau - mean_until_next(recording.wrench_torque, early)[measured]
        position = motion.q.T - recording.q[measured]
        torque = as_logged(tau, recording, delay) - recording.tau[measured]
        torque[:, : self.problem.robot.base_joints] = 0.0  # they have no motors
        return [
            ReplayError(
                joint_names=recording.joint_names,
                position_units=tuple(position_units(self.problem)),
                torque_units=tuple(torque_units(self.problem)),
                position=np.sqrt(np.mean(position[span] ** 2, axis=0)),
                torque=np.sqrt(np.mean(torque[span] ** 2, axis=0)),
                torque_size=np.sqrt(np.mean(recording.tau[span] ** 2, axis=0)),
                samples=len(position[span]),
            )
            for span in spans
        ]


def as_logged(
    tau: np.ndarray, recording: Recording, drive_delay: float | None = None
) -> np.ndarray:
    """Simulated torque, held from each sample on, as the recording's torque channel has it.

    Args:
        tau: shape (samples, joints) [N m or N].
        recording: whose delay and timing are applied.
        drive_delay: of the simulated drives [s]; None: that of the recording.

    Returns:
        Torque at the instants of the recording, shape (samples, joints) [N m or N].
    """
    lag = recording.delay * recording.rate
    if recording.torque_timing == "averaged":
        lag += recording.rate / recording.control_rate
    # the log holds what the drive was commanded, the simulation what acts
    late = recording.drive_delay if drive_delay is None else drive_delay
    waiting = np.ceil(late * recording.control_rate - 1e-9)
    lag -= waiting * recording.rate / recording.control_rate
    source = np.floor(np.arange(len(tau)) - lag + 1e-6).astype(int)
    return tau[np.clip(source, 0, len(tau) - 1)]


def has_own_loop(found: Identification) -> bool:
    """Whether unknowns of the closed loop were identified with the model."""
    simulation = found.simulation
    return simulation is not None and simulation.loop == "closed" and bool(
        simulation.loop_parameters
    )  # fmt: skip


def drive_delay(found: Identification, declared: float) -> float:
    """Delay of the drives in a fitted closed loop [s]; ``declared`` where it was not sought."""
    own = found.simulation.loop_parameters if found.simulation and has_own_loop(found) else ()
    return next((p.value for p in own if p.name == "delay"), declared)


def with_loop_parameters(
    problem: Problem, loop: ParametrisedLoop, found: Identification
) -> ParametrisedLoop:
    """A loop as it was declared, with the values that a fit gave its unknowns."""
    own = () if found.simulation is None else found.simulation.loop_parameters
    unknowns = loop_unknowns(problem, loop, [p.name for p in own])
    return with_values(loop, unknowns, np.array([p.value for p in own]))


def motion_of(loop: ParametrisedLoop) -> Trajectory:
    """Motion of a loop."""
    return simulate(loop.model, loop.controller, loop.signals, loop.robot.joint_names, loop.begin)


def encoder_offsets(loop: ParametrisedLoop) -> np.ndarray:
    """What the encoders show beside the position, shape (joints,) [rad or m]."""
    noise = loop.signals.noise
    return np.zeros(loop.robot.size) if noise is None else np.asarray(noise)[0]


def closed_motion(
    problem: Problem, kinematics: Kinematics, found: Identification, samples: int
) -> SimulatedMotion:
    """What encoders and torque show of the fitted closed loop of a problem's only recording.

    Raises:
        SimulationDiverged: the loop with these values is unstable.
    """
    assert problem.loop is not None
    (stretch,) = closed_stretches(
        problem, problem.loop, found.parameters, found.theta, [kinematics]
    )
    loop = with_loop_parameters(problem, stretch.loop, found)
    made, rate = motion_of(loop), kinematics.recording.rate
    shown = made.q + encoder_offsets(loop)
    q, tau = (_at(signal, made.rate / rate, samples) for signal in (shown, made.tau))
    return SimulatedMotion(q.T, rate, None, tau.T)


def _at(signal: np.ndarray, ratio: float, samples: int) -> np.ndarray:
    """A simulated signal at the samples of a record; ``ratio``: of its rate to the record's."""
    step = round(ratio)
    if step >= 1 and abs(ratio - step) < 1e-9:
        return signal[::step][:samples]
    last = int((len(signal) - 1) / ratio + 1e-6)
    return cubic_spline(np.arange(len(signal)) / ratio, signal)(np.arange(min(samples, last + 1)))


class OpenLoop:
    """Stretches of one recording, driven by its torques, with any estimate of a problem."""

    def __init__(self, problem: Problem, judge: Judge) -> None:
        self.problem, self.judge = problem, judge

    def score(self, found: Identification, spans: Sequence[slice]) -> list[SimulationError]:
        """Errors of an estimate on stretches of the recording.

        Raises:
            SimulationDiverged: a stretch leaves what was measured altogether.
            MassMatrixNotPositiveDefinite: the estimate is that of no machine.
        """
        return [self._error(found, span) for span in spans]

    def _error(self, found: Identification, span: slice) -> SimulationError:
        recording, smooth = self.judge.recording, self.judge.kinematics
        start, stop, _ = span.indices(recording.samples)
        part = recording.part(start, stop)
        cut: Kinematics = replace(smooth, q=smooth.q[:, start:stop], dq=smooth.dq[:, start:stop])
        problem = replace(self.problem, recordings=(part,))
        method = found.method_used
        longest = None if method is None else method.horizon
        squares, samples = np.zeros(recording.joints), 0
        for stretch in open_stretches(problem, found.parameters, found.theta, [cut], longest):
            loop = with_loop_parameters(problem, stretch.loop, found)
            own = (motion_of(loop).q + encoder_offsets(loop))[:: stretch.step][: stretch.samples]
            squares += np.sum((own - stretch.q[: len(own)]) ** 2, axis=0)
            samples += len(own)
        return SimulationError(
            "open", recording.joint_names, tuple(position_units(problem)),
            np.sqrt(squares / samples), samples,
        )  # fmt: skip
