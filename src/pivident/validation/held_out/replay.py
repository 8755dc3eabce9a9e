"""Closed-loop replay: the loop simulated with an estimate, beside what the machine did.

The simulation is given the reference, the control law and the known inputs, no measured position
after the first and no torque. A recording is simulated from its beginning to the end of what is
scored, since a law with memory cannot be started in the middle.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pivident.estimation.auxiliary_model import AuxiliaryModel, mean_until_next
from pivident.estimation.identification import Identification
from pivident.estimation.problem import Problem, position_units, torque_units
from pivident.motion.motion import SimulatedMotion
from pivident.recording.recording import Recording
from pivident.validation.held_out.fitted_loop import closed_motion, drive_delay, has_own_loop
from pivident.validation.held_out.prediction import Judge, total_error


@dataclass(frozen=True, eq=False)
class ReplayError:
    """Errors of a simulated loop over some samples; arrays (joints,)."""

    joint_names: tuple[str, ...]  # names of the joints
    position_units: tuple[str, ...]  # rad or m
    torque_units: tuple[str, ...]  # N m or N
    position: np.ndarray  # rms of simulated minus measured positions [rad or m]
    torque: np.ndarray  # rms of simulated minus measured torques [N m or N]
    torque_size: np.ndarray  # rms of the measured torques [N m or N]
    samples: int  # number of samples

    @property
    def relative(self) -> np.ndarray:
        """100 torque error/torque of each joint [%]."""
        return 100.0 * self.torque / np.maximum(self.torque_size, 1e-300)

    @property
    def total(self) -> float:
        """Torque error over all joints [%]."""
        driven = self.torque_size > 0.0  # without the joints of a measured base
        units = [unit for unit, own in zip(self.torque_units, driven, strict=True) if own]
        return total_error(self.torque[driven], self.torque_size[driven], units)


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


def pooled_replay(errors: Sequence[ReplayError]) -> ReplayError:
    """One score of several stretches: squares are averaged over all samples."""
    weights = [e.samples for e in errors]

    def mean(name: str) -> np.ndarray:
        squares = [getattr(e, name) ** 2 for e in errors]
        return np.sqrt(np.average(squares, axis=0, weights=weights))

    return replace(
        errors[0],
        position=mean("position"),
        torque=mean("torque"),
        torque_size=mean("torque_size"),
        samples=sum(weights),
    )
