"""From a problem to stretches: records beside the loops that simulate them.

A closed loop forgets where it started, and is compared from then on. What forgets slowly, and an
open loop, is compared from its first sample; its initial state is then sought with the unknowns.
The *horizon* is how long a simulation runs before it begins anew from the measured state: the whole
record, some seconds, or a move from rest to rest.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Literal

import numpy as np

from pivident.data.recording.recording import Recording
from pivident.dynamics.parameters import Parameter
from pivident.estimation.auxiliary_model import FORGOTTEN, loop_signals
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
from pivident.loop.simulation.controllers import TAPS, Controller, PythonController, SampledLaw
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
#: Growth from which on an open loop cannot be simulated over a record: of a micrometre to a
#: millimetre.
UNSTABLE = 1e3
#: Share of its largest speed below which a joint turns or rests, and shortest move [s].
AT_REST, SHORTEST_MOVE = 0.03, 0.1
#: Share of the largest speed by which those of moves of one kind differ at most.
SAME_MOVE = 0.1
#: Moves from which on a stretch is a long run: its errors are what the model lacks, added up over
#: time, of which there are as many as moves, not as many as samples.
LONG = 4
#: Kinds of moves that are told apart at most.
MAX_KINDS = 10
#: Distance from the measured motion, in ranges of it, and speed, in largest speeds, at which an
#: open loop counts as diverged.
MAX_DISTANCE, MAX_SPEED = 10.0, 20.0


#: Fewest samples of a stretch.
SHORTEST = 16

#: How long a simulation runs from a measured state: over a move, so many seconds, the record; None:
#: what the loop allows.
Horizon = float | Literal["moves", "record"] | None


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
        state: smoothed positions and speeds, shape (2, samples, joints); None: not known, and the
            stretch cannot be cut.
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
    state: np.ndarray | None = None

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

    def part(self, start: int, stop: int) -> Stretch:
        """Some measured samples, from the smoothed state at the first of them."""
        assert self.state is not None
        span = slice(start, stop)
        signals = self.loop.signals.part(slice(start * self.step, stop * self.step))
        q, dq = self.state[:, start]
        return replace(
            self,
            loop=replace(self.loop, signals=signals, start=(q.copy(), dq.copy())),
            q=self.q[span],
            tau=None if self.tau is None else self.tau[span],
            moving=self.moving[span],
            start_time=self.start_time + start / self.rate,
            state=self.state[:, span],
        )

    @property
    def moves(self) -> list[int]:
        """Samples at which moves from rest to rest begin, and the end of the last one.

        A move ends in the middle of the time in which all joints turn or rest.
        """
        assert self.state is not None
        speed = np.abs(self.state[1])
        still = (speed <= AT_REST * speed.max(axis=0)).all(axis=1).astype(int)
        rests = np.flatnonzero(np.diff(still, prepend=0, append=0)).reshape(-1, 2)
        shortest, edges = round(SHORTEST_MOVE * self.rate), [0]
        for middle in rests.mean(axis=1).astype(int).tolist():
            if edges[-1] + shortest <= middle <= self.samples - shortest:
                edges.append(middle)
        return [*edges, self.samples]

    @property
    def is_long_run(self) -> bool:
        """Whether an open loop runs over several moves."""
        is_open = isinstance(self.loop.controller, OpenLoop) and self.state is not None
        return is_open and len(self.moves) > LONG


def closed_stretches(
    problem: Problem,
    loop: Loop,
    parameters: tuple[Parameter, ...],
    theta: np.ndarray,
    kinematics: Sequence[Kinematics],
    horizon: Horizon = None,
) -> list[Stretch]:
    """Stretches of each recording in its closed loop: by default the whole of it.

    ``parameters``: what is simulated, ``theta``: their values; ``kinematics``: smoothed motions.

    Raises:
        SimulationDiverged: the loop with these values is unstable.
        ExperimentError: the law has a memory, so that it cannot begin in the middle of a record.
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
        whole = _stretch(problem, recording, smooth, own)
        edges = _edges(whole, horizon or "record")
        if len(edges) > 2 and remembers(controller, signals):
            raise ExperimentError(
                f"the simulated loop of recording {recording.name!r} would begin anew at "
                f"{edges[1] / whole.rate:.3g} s, where the state of its control law is not known",
                advice='leave horizon out, or "record": this law has an integrator or a program',
            ).about("horizon")
        for ends in pairwise(edges):
            stretch = whole.part(*ends)
            first = _forgotten(stretch.loop, stretch)
            if first <= MAX_FORGETTING * stretch.samples:
                stretch = replace(stretch, first=first, start_std=None)
            stretches.append(stretch)
    return stretches


def remembers(controller: Controller, signals: LoopSignals) -> bool:
    """Whether a control law has a state beside the last positions that it read."""
    if isinstance(controller, PythonController):
        return True
    law = controller.law(float(signals.rate), signals.q_ref, signals.dq_ref)
    return bool(law.integral_gain.any())


def open_stretches(
    problem: Problem,
    parameters: tuple[Parameter, ...],
    theta: np.ndarray,
    kinematics: Sequence[Kinematics],
    horizon: Horizon = None,
) -> list[Stretch]:
    """Stretches driven by the recorded torques.

    ``horizon``: None: the record, as far as an error of its initial state does not grow
    ``MAX_GROWTH``-fold. An arm under gravity falls away from any motion; beyond that the errors are
    no smooth function of the unknowns any more.

    Raises:
        ExperimentError: the torque is no input: it was not logged at the rate of the simulation; or
            the record was asked for, and its open loop is unstable.
    """
    stretches = []
    for recording, smooth in zip(problem.recordings, kinematics, strict=True):
        signals = _open_signals(recording, smooth.q.T, smooth.dq.T)
        loop = ParametrisedLoop(problem.robot, parameters, theta, OpenLoop(), signals, clip=True)
        whole = replace(_stretch(problem, recording, smooth, loop), tau=None)
        if horizon == "record":
            _refuse_unstable(whole)
        edges = _edges_by_growth(whole) if horizon is None else _edges(whole, horizon)
        stretches += [_known_start(whole.part(*ends)) for ends in pairwise(edges)]
    return stretches


def _refuse_unstable(whole: Stretch) -> None:
    """An open loop that is to run over a record has to be one that can."""
    with suppress(SimulationDiverged, MassMatrixNotPositiveDefinite):  # of values that are far off
        if (stable := _grown(whole.loop, UNSTABLE)) < whole.samples:
            raise ExperimentError(
                f"in open loop an error of the initial state of recording {whole.name!r} grows "
                f"{UNSTABLE:g}-fold within {stable / whole.rate:.3g} of its "
                f"{whole.samples / whole.rate:.3g} s, and no run over the record means anything",
                advice="simulate the closed loop (cloe, clie, ml), which comes back to its "
                "reference, or leave horizon out: runs then end before errors grow",
            ).about("horizon")


def longest_run(stretches: Sequence[Stretch]) -> float:
    """Longest time that is simulated from a measured state [s]."""
    return max(own.samples / own.rate for own in stretches)


def kinds_of_moves(stretches: Sequence[Stretch]) -> list[list[tuple[int, int]]]:
    """Moves that repeat one another, each as its stretch and its place there.

    Of one kind are those whose joints reach about the same speeds in the same directions; once
    there are ``MAX_KINDS``, a move joins the nearest one.
    """
    peaks: list[np.ndarray] = []
    kinds: list[list[tuple[int, int]]] = []
    for s, stretch in enumerate(stretches):
        assert stretch.state is not None
        largest = np.abs(stretch.state[1]).max(axis=0) + 1e-300
        for place, ends in enumerate(pairwise(stretch.moves)):
            speed = stretch.state[1, slice(*ends)] / largest
            peak = speed[np.abs(speed).argmax(axis=0), np.arange(speed.shape[1])]
            apart = [float(np.abs(peak - other).max()) for other in peaks]
            if len(peaks) < MAX_KINDS and min(apart, default=np.inf) >= SAME_MOVE:
                peaks.append(peak)
                kinds.append([(s, place)])
            else:
                kinds[int(np.argmin(apart))].append((s, place))
    return kinds


def without_moves(
    stretches: Sequence[Stretch], left_out: Sequence[tuple[int, int]]
) -> list[Stretch]:
    """What is left of stretches, each piece from its own measured state."""
    pieces = []
    for s, own in enumerate(stretches):
        starts = [0, *(own.moves[place + 1] for stretch, place in left_out if stretch == s)]
        stops = [*(own.moves[place] for stretch, place in left_out if stretch == s), own.samples]
        pieces += [own.part(*ends) for ends in zip(starts, stops, strict=True) if ends[0] < ends[1]]
    return pieces


def _known_start(stretch: Stretch) -> Stretch:
    """With an initial state that a long run cannot bend to its own errors.

    One of many correlated errors is no witness: the weight of the smoothed state grows by what
    samples have over moves.
    """
    if stretch.start_std is None or not stretch.is_long_run:
        return stretch
    share = (len(stretch.moves) - 1) / stretch.samples
    return replace(stretch, start_std=np.sqrt(share) * stretch.start_std)


def _edges(whole: Stretch, horizon: Horizon) -> list[int]:
    """Samples at which stretches of a given horizon begin and end."""
    samples = whole.samples
    if horizon == "moves":
        return whole.moves
    if horizon is None or horizon == "record":
        return [0, samples]
    longest = min(max(horizon * whole.rate, SHORTEST), samples)
    return np.linspace(0, samples, int(np.ceil(samples / longest)) + 1).astype(int).tolist()


def _edges_by_growth(whole: Stretch) -> list[int]:
    """Samples at which stretches begin and end: where an error of the start has grown too much."""
    samples = whole.samples
    shortest = max(SHORTEST, round(MIN_SECONDS * whole.rate))
    edges = [0]
    while samples - edges[-1] > 2 * shortest:
        begin = edges[-1]
        end = begin + max(shortest, _tame(whole.part(begin, samples).loop))
        if end + shortest >= samples:
            break
        edges.append(end)
    return [*edges, samples]


def _tame(loop: ParametrisedLoop) -> int:
    """Samples until an error of an initial position has grown ``MAX_GROWTH``-fold."""
    try:
        return _grown(loop, MAX_GROWTH)
    except (SimulationDiverged, MassMatrixNotPositiveDefinite) as error:
        return int(error.time * float(loop.signals.rate))


def _grown(loop: ParametrisedLoop, growth: float) -> int:
    """Samples until an error of an initial position has grown so many times."""
    for made in tangent_blocks(loop, start_directions(loop.robot.size)[: loop.robot.size]):
        grown = np.flatnonzero((np.abs(made.q) > growth).any(axis=(1, 2)))
        if grown.size:
            return made.samples.start + int(grown[0])
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
    state, step = np.stack([smooth.q.T, smooth.dq.T]), round(control / rate)
    if step < 1 or abs(control / rate - step) > 1e-9:
        t = np.arange(len(q)) / rate
        wanted = np.arange(len(loop.signals.q_ref)) / control
        q = cubic_spline(t, q)(wanted)
        tau = np.stack([np.interp(wanted, t, own) for own in recording.tau.T], axis=1)
        nearest = np.minimum((wanted * rate + 0.5).astype(int), len(moving) - 1)
        moving, state, step = moving[nearest], state[:, nearest], 1
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
        recording.name, loop, q, tau, step, round(late), moving, recording.start_time, start_std,
        state=state,
    )  # fmt: skip


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
