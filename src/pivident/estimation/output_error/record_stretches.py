"""From a problem to stretches: records beside the loops that simulate them.

A closed loop forgets where it started, and is compared from then on. What forgets slowly, and an
open loop, is compared from its first sample; its initial state is then sought with the unknowns.
Long open loops may be cut into stretches, each with an initial state of its own.

A stretch of a record beside the loop that simulates it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from pivident.data.recording.recording import Recording
from pivident.dynamics.parameters import Parameter
from pivident.estimation.auxiliary_model import loop_signals
from pivident.estimation.output_error.loop_unknowns import start_directions
from pivident.estimation.problem import Problem
from pivident.foundation.errors import (
    ExperimentError,
    MassMatrixNotPositiveDefinite,
    SimulationDiverged,
)
from pivident.foundation.scratch import working_array
from pivident.loop.motion.motion import Kinematics, measured_samples
from pivident.loop.simulation.closed_loop import LoopSignals, simulate_blocks
from pivident.loop.simulation.control_loop import Loop, with_measured_gravity
from pivident.loop.simulation.controllers import TAPS, SampledLaw
from pivident.loop.simulation.direction import ParametrisedLoop
from pivident.loop.simulation.loop_kernel import TORQUE
from pivident.loop.simulation.tangents import tangent_blocks
from pivident.signals.cubic_spline import cubic_spline


@dataclass(frozen=True)
class OpenLoop:
    """u = 0: what acts are the known inputs times the drive gain."""

    def check(self, joints: int) -> None:
        """Fits any number of joints."""

    def law(self, rate: float, q_ref: np.ndarray, dq_ref: np.ndarray | None) -> SampledLaw:
        """No feedback, no integrator, no share of the reference.

        Args:
            rate: rate of the simulation [Hz].
            q_ref: reference positions, shape (samples, joints) [rad or m].
            dq_ref: reference speeds, likewise, or None.

        Returns:
            The law as arrays, all zero but the leading coefficients of its denominators.
        """
        n = q_ref.shape[1]
        none, monic = np.zeros((n, TAPS)), np.zeros((n, TAPS))
        monic[:, 0] = 1.0
        return SampledLaw(
            none, monic, none, np.zeros(n), np.zeros_like(q_ref), np.zeros_like(q_ref)
        )


#: The start is forgotten once its trace in the torque is this share of the torque's standard
#: deviation.
FORGOTTEN = 1e-4
#: Share of a record that may pass until then; a loop that takes longer has its start sought.
MAX_FORGETTING = 0.2
#: Standard deviations of initial positions and speeds that are sought, in those of the smoothed
#: record, σ of the encoder and 2π f50 σ: at its ends a record is known less well than inside.
START_ERRORS = 10.0
#: The least of them, as a share of range and largest speed.
LEAST_START = 1e-6
#: Growth of an error of the initial state at which an open loop is cut, and the shortest stretch
#: [s].
MAX_GROWTH, MIN_SECONDS = 5.0, 0.5
#: Distance from the measured motion, in ranges of it, and speed, in largest speeds, at which an
#: open loop counts as diverged.
MAX_DISTANCE, MAX_SPEED = 10.0, 20.0


@dataclass(frozen=True, eq=False)
class Stretch:
    """What was measured over some time, and the loop that is to give it.

    Attributes:
        name: name of the recording, for messages.
        loop: the loop at its control rate, with the initial state that the record suggests.
        q: measured positions, shape (samples, joints) [rad or m].
        tau: measured torques, likewise [N m or N]; None: none were.
        step: samples of the loop from one measured sample to the next.
        tau_late: how many samples of the loop a measured torque is later than the one that acts,
            a drive's delay not counted.
        moving: samples of the record at which each joint is compared, (samples, joints): at
            standstill dry friction follows no law. In an open loop positions are compared there.
        start_time: time of the first sample [s].
        start_std: how far initial positions and speeds may lie from those of ``loop``: standard
            deviations, shape (2 joints,); None: they are not sought.
        first: measured sample from which on is compared.
    """

    name: str
    loop: ParametrisedLoop
    q: np.ndarray
    tau: np.ndarray | None
    step: int
    tau_late: int
    moving: np.ndarray
    start_time: float
    start_std: np.ndarray | None
    first: int = 0

    @property
    def rate(self) -> float:
        """Rate of the measured samples [Hz]."""
        return float(self.loop.signals.rate) / self.step

    @property
    def samples(self) -> int:
        """Measured samples."""
        return len(self.q)

    def with_loop(self, loop: ParametrisedLoop) -> Stretch:
        """The same record beside another loop."""
        return replace(self, loop=loop)


def closed_stretches(
    problem: Problem,
    loop: Loop,
    parameters: tuple[Parameter, ...],
    theta: np.ndarray,
    kinematics: Sequence[Kinematics],
) -> list[Stretch]:
    """One stretch for each recording, in its closed loop.

    ``parameters``: what is simulated, ``theta``: their values; ``kinematics``: smoothed motions.

    Raises:
        SimulationDiverged: the loop with these values is unstable.
    """
    controller = with_measured_gravity(
        loop.controller, problem.robot, loop.drive_gain, loop.feed_forward
    )
    stretches = []
    for recording, smooth in zip(problem.recordings, kinematics, strict=True):
        signals, begin = loop_signals(problem.robot, loop, recording, smooth.q.T, smooth.dq.T)
        own = ParametrisedLoop(
            problem.robot, parameters, theta, controller, signals, begin, clip=True
        )
        stretch = _stretch(problem, recording, smooth, own)
        first = _forgotten(own, stretch)
        if first <= MAX_FORGETTING * stretch.samples:
            stretches.append(replace(stretch, first=first, start_std=None))
        else:
            stretches.append(stretch)
    return stretches


def open_stretches(
    problem: Problem,
    parameters: tuple[Parameter, ...],
    theta: np.ndarray,
    kinematics: Sequence[Kinematics],
    seconds: float | None,
) -> list[Stretch]:
    """Stretches driven by the recorded torques.

    ``seconds``: the longest one; None: it ends where an error of its initial state has grown
    ``MAX_GROWTH``-fold. An arm under gravity falls away from any motion; beyond that the errors are
    no smooth function of the unknowns any more.

    Raises:
        ExperimentError: the torque is no input: it was not logged at the rate of the simulation.
    """
    stretches = []
    for recording, smooth in zip(problem.recordings, kinematics, strict=True):

        def cut(start: int, stop: int, recording=recording, smooth=smooth) -> Stretch:
            span = slice(start, stop)
            part = recording.part(start, stop)
            seen = None if smooth.measured is None else smooth.measured[:, span]
            own = replace(smooth, q=smooth.q[:, span], dq=smooth.dq[:, span], measured=seen)
            q, dq = own.q.T, own.dq.T
            signals = _open_signals(part, q, dq)
            begin = (q[0].copy(), dq[0].copy())
            loop = ParametrisedLoop(
                problem.robot, parameters, theta, OpenLoop(), signals, begin, clip=True
            )
            return replace(_stretch(problem, part, own, loop), tau=None)

        samples = recording.samples
        if seconds is None:
            edges = _edges_by_growth(cut, samples, recording.rate)
        else:
            longest = max(seconds * recording.rate, 16.0)
            count = max(1, int(np.ceil(samples / min(longest, samples))))
            edges = np.linspace(0, samples, count + 1).astype(int).tolist()
        stretches += [cut(*edge) for edge in pairwise(edges)]
    return stretches


def _edges_by_growth(cut: Callable[[int, int], Stretch], samples: int, rate: float) -> list[int]:
    """Samples at which stretches begin and end: where an error of the start has grown too much."""
    shortest = max(16, round(MIN_SECONDS * rate))
    edges = [0]
    while samples - edges[-1] > 2 * shortest:
        begin = edges[-1]
        end = begin + max(shortest, _tame(cut(begin, samples).loop))
        if end + shortest >= samples:
            break
        edges.append(end)
    return [*edges, samples]


def _tame(loop: ParametrisedLoop) -> int:
    """Samples until an error of an initial position has grown ``MAX_GROWTH``-fold."""
    starts = start_directions(loop.robot.size)[: loop.robot.size]
    try:
        for made in tangent_blocks(loop, starts):
            grown = np.flatnonzero((np.abs(made.q) > MAX_GROWTH).any(axis=(1, 2)))
            if grown.size:
                return made.samples.start + int(grown[0])
    except (SimulationDiverged, MassMatrixNotPositiveDefinite) as error:
        return int(error.time * float(loop.signals.rate))
    return len(loop.signals.q_ref)


def _open_signals(recording: Recording, q: np.ndarray, dq: np.ndarray) -> LoopSignals:
    """The recorded torque as input; a mean over the period before its sample acts one earlier."""
    n, tau = recording.joints, recording.tau
    if recording.torque_timing == "sampled":
        raise ExperimentError(
            f"the torques of recording {recording.name!r} are values at instants (torque_timing = "
            '"sampled")',
            advice="an open loop needs what acts between the samples. Use cloe, clie or ml, "
            'or declare torque_timing = "held" if the drive holds them',
        ).about("torque_timing")
    early = recording.delay * recording.rate + (recording.torque_timing == "averaged")
    if early:
        at = np.clip(np.arange(len(tau)) + early, 0, len(tau) - 1)
        tau = np.stack([np.interp(at, np.arange(len(tau)), own) for own in tau.T], axis=1)
    reach = np.ptp(q, axis=0) + 1e-3
    return LoopSignals(
        rate=recording.rate,
        q_ref=q,
        dq_ref=dq,
        inputs=tau,
        noise=None,
        drive_gain=np.ones(n),
        limit=np.full(n, np.inf),
        bound=MAX_DISTANCE * reach,
        speed_bound=MAX_SPEED * (np.abs(dq).max(axis=0) + 1e-3),
        drive_delay=recording.drive_delay,
    )


def _stretch(
    problem: Problem, recording: Recording, smooth: Kinematics, loop: ParametrisedLoop
) -> Stretch:
    """A recording beside its loop; at rates that do not fit it is interpolated to the loop's."""
    rate, control = recording.rate, float(loop.signals.rate)
    q, tau = recording.q, recording.tau
    moving = (problem.speed_limits(recording).moving(smooth.dq) & measured_samples(smooth)).T
    step = round(control / rate)
    if step < 1 or abs(control / rate - step) > 1e-9:
        t = np.arange(len(q)) / rate
        wanted = np.arange(len(loop.signals.q_ref)) / control
        q = cubic_spline(t, q)(wanted)
        tau = np.stack([np.interp(wanted, t, own) for own in recording.tau.T], axis=1)
        moving = moving[np.minimum((wanted * rate + 0.5).astype(int), len(moving) - 1)]
        step = 1
    late = recording.delay * control + step * (recording.torque_timing == "averaged")
    reach, fastest = np.ptp(smooth.q, axis=1), np.abs(smooth.dq).max(axis=1)
    position, speed = smooth.encoder_std, 2.0 * np.pi * smooth.f50 * smooth.encoder_std
    start_std = np.concatenate(
        [
            START_ERRORS * np.nan_to_num(position, posinf=0.0) + LEAST_START * reach,
            START_ERRORS * np.nan_to_num(speed, posinf=0.0) + LEAST_START * fastest,
        ]
    )
    return Stretch(
        recording.name, loop, q, tau, step, round(late), moving, recording.start_time, start_std, 0
    )


def _forgotten(loop: ParametrisedLoop, stretch: Stretch) -> int:
    """First measured sample at which the loop has forgotten its start."""
    names, other = loop.robot.joint_names, (loop.signals.q_ref[0], np.zeros(loop.robot.size))
    here, there = (
        simulate_blocks(loop.model, loop.controller, loop.signals, names, start)
        for start in (loop.begin, other)
    )
    trace = working_array((len(loop.signals.q_ref), loop.robot.size))
    total, squares = np.zeros((2, loop.robot.size))
    for (span, made, _), (_, elsewhere, _) in zip(here, there, strict=True):
        tau = made[TORQUE]
        trace[span] = np.abs(tau - elsewhere[TORQUE])
        total += tau.sum(axis=0)
        squares += (tau**2).sum(axis=0)
    mean = total / len(trace)
    std = np.sqrt(np.maximum(squares / len(trace) - mean**2, 0.0))
    seen = np.flatnonzero((trace > FORGOTTEN * std).any(axis=1))
    return -(-(int(seen[-1]) + 1) // stretch.step) if seen.size else 0
