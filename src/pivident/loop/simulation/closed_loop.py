"""The auxiliary model: reference, controller and parameters give q, dq, ddq and tau.

The digital law stays in the loop: at each control sample it reads the position, and its torque is
held over the period. Accelerations at a sample are those right after the new torque was applied.
"""

from __future__ import annotations

import threading
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from pivident.dynamics.forward import Model
from pivident.dynamics.friction_table import SPRINGS
from pivident.foundation.compiled import read_only
from pivident.foundation.errors import (
    ExperimentError,
    LoopOpened,
    MassMatrixNotPositiveDefinite,
    ShapeMismatch,
    SimulationDiverged,
)
from pivident.foundation.text.display import Displayed
from pivident.loop.simulation.controllers import (
    TAPS,
    Controller,
    PythonController,
    SampledLaw,
    backward_difference,
)
from pivident.loop.simulation.integration import Q
from pivident.loop.simulation.loop_kernel import (
    CHANNELS,
    COUNT,
    DISTANCE,
    DONE,
    GAIN,
    INDEFINITE,
    LIMITS,
    NOT_CLOSED,
    OUTPUT,
    SPEED,
    TOO_FAR,
    TOO_FAST,
    initial_state,
    loops_of,
    path_arguments,
    run_loop,
)
from pivident.loop.simulation.loop_tangent import LoopTangent

#: A law may keep a state of its own: records that are simulated in parallel must not share it.
_ONE_RUN_AT_A_TIME = threading.Lock()


def run_python_loop(
    model: Model,
    controller: PythonController,
    start: tuple[np.ndarray, np.ndarray],
    rate: float,
    delay: float,
    q_ref: np.ndarray,
    dq_ref: np.ndarray,
    inputs: np.ndarray,
    noise: np.ndarray,
    limits: np.ndarray,
    steps: int,
    oracle: int | None,
    channels: np.ndarray,
    failure: np.ndarray,
) -> tuple[int, int, int, np.ndarray | None]:
    """Simulate all samples of the reference; arguments and answer are those of ``run_loop``.

    The answer ends with the states of friction, see ``path_arguments``.

    ``delay``: time from a sample until the torque that answers it acts [s]; ``q_ref``: reference
    positions, shape (samples, joints); ``inputs``: added to the law's output, shape
    (samples, joints) or (1, joints); ``oracle``: None, or Runge–Kutta substeps per control period.
    """
    samples, n = q_ref.shape
    # a law without feedback: its reference is what the function says
    none, unit = np.zeros((n, TAPS)), np.tile(np.eye(1, TAPS), (n, 1))
    said = np.zeros((samples, n))
    law = SampledLaw(none, unit, none, np.zeros(n), said, said).protected()
    state = initial_state(model, law, start[0], start[1], int(delay * rate + 1e-9))
    on_path, loops = (
        path_arguments(model.friction, state, samples, oracle),
        loops_of(model, start[0]),
    )
    heard = read_only(np.zeros((1, n)))
    q_wanted, dq_wanted = read_only(q_ref), read_only(dq_ref)
    with _ONE_RUN_AT_A_TIME:
        if controller.reset is not None:
            controller.reset()
        for k in range(samples):
            measured = in_whole_counts(
                state.vectors[Q] + noise[k if len(noise) > 1 else 0], limits[COUNT]
            )
            said[k] = _checked(controller.function(k, measured, q_wanted[k], dq_wanted[k]), k, n)
            what, joint, _ = run_loop(
                model, law, state, rate, delay, q_ref, inputs, heard, limits, steps, oracle,
                k, k + 1, 0, channels, failure, None, *on_path, loops,
            )  # fmt: skip
            if what != DONE:
                return what, joint, k, on_path[-1]
    return DONE, -1, -1, on_path[-1]


def in_whole_counts(q: np.ndarray, count: ArrayLike) -> np.ndarray:
    """Positions in whole counts [rad or m], shape (…, joints); those of a zero count unchanged.

    ``count``: what is counted in, of all joints or of each [rad or m].
    """
    step = np.broadcast_to(np.asarray(count, dtype=float), q.shape[-1:])
    whole = np.round(np.divide(q, step, out=np.zeros_like(q), where=step > 0.0))
    return np.where(step > 0.0, step * whole, q)


def _checked(answer: object, k: int, joints: int) -> np.ndarray:
    u = np.asarray(answer, dtype=float)
    if u.shape != (joints,) or not np.isfinite(u).all():
        raise ExperimentError(
            f"the Python control law answered {answer!r} at sample {k}",
            advice=f"it must return {joints} finite numbers, one for each joint",
        )
    return u


#: Samples that are simulated at a time where a run is taken in stretches.
BLOCK = 4096

#: Longest step over which a rigid body that changes with the motion may be frozen [s].
MAX_STEP = 2.5e-4


@dataclass(frozen=True, eq=False)
class Trajectory(Displayed):
    """A simulated motion; all arrays (samples, joints)."""

    rate: float  # samples per second [Hz]
    q: np.ndarray  # positions [rad or m]
    dq: np.ndarray  # speeds [rad/s or m/s]
    ddq: np.ndarray  # accelerations, right after each sample's torque [rad/s² or m/s²]
    tau: np.ndarray  # joint torques or forces, held from each sample on [N m or N]
    command: np.ndarray  # controller output after saturation [unit of the controller]
    #: States z of friction that remembers its path, in the order of its table's ``memories``,
    #: shape (samples, states).
    friction_states: np.ndarray


@dataclass(frozen=True, eq=False)
class LoopSignals:
    """What drives a simulated loop, sampled at the control rate; arrays (samples, joints)."""

    rate: float  # control rate [Hz]
    q_ref: np.ndarray  # reference positions [rad or m]
    #: Reference speeds, or None: the law takes differences where it needs them.
    dq_ref: np.ndarray | None
    #: Known inputs added to the controller's output [unit of the controller].
    inputs: np.ndarray | None
    #: Encoder noise added to the position that the controller reads [rad or m].
    noise: np.ndarray | None
    drive_gain: np.ndarray  # joint torque per controller output, shape (joints,)
    limit: np.ndarray  # largest controller output, shape (joints,); infinite where there is none
    #: Largest distance from the reference before the run counts as diverged [rad or m], shape
    #: (joints,).
    bound: np.ndarray
    speed_bound: np.ndarray  # largest speed before the run counts as diverged, shape (joints,)
    drive_delay: float = 0.0  # time from a sample until the torque that answers it acts [s]
    #: What the encoder counts in that the controller reads [rad or m], shape (joints,); None: it
    #: reads positions without counts.
    count: np.ndarray | None = None

    def part(self, span: slice) -> LoopSignals:
        """The signals of some samples alone; single rows stand for all samples."""

        def cut(signal: np.ndarray | None) -> np.ndarray | None:
            return signal if signal is None or len(signal) == 1 else signal[span]

        return replace(
            self,
            q_ref=self.q_ref[span],
            dq_ref=cut(self.dq_ref),
            inputs=cut(self.inputs),
            noise=cut(self.noise),
        )


def simulate(
    model: Model,
    controller: Controller,
    signals: LoopSignals,
    joint_names: tuple[str, ...],
    start: tuple[np.ndarray, np.ndarray] | None = None,
    oracle: int | None = None,
) -> Trajectory:
    """Simulate the closed loop over all samples of the reference.

    ``start``: initial positions and speeds, each (joints,); default: at rest on the reference;
    ``oracle``: None: the fast scheme; else Runge–Kutta 4 with so many substeps per control period.
    """
    samples = len(signals.q_ref)
    blocks = simulate_blocks(model, controller, signals, joint_names, start, oracle, samples)
    _, (q, dq, ddq, tau, command), states = next(blocks)
    return Trajectory(float(signals.rate), q, dq, ddq, tau, command, states)


def simulate_blocks(
    model: Model,
    controller: Controller,
    signals: LoopSignals,
    joint_names: tuple[str, ...],
    start: tuple[np.ndarray, np.ndarray] | None = None,
    oracle: int | None = None,
    block: int = BLOCK,
    tangent: LoopTangent | None = None,
) -> Iterator[tuple[slice, np.ndarray, np.ndarray]]:
    """Simulate a stretch at a time, so that a long run needs no memory for all of its channels.

    Result: the samples, the channels q, dq, ddq, tau and command on them, shape
    (5, stretch, joints), and the states of friction, shape (stretch, states). The next stretch
    overwrites both. ``tangent``: tangents that are carried along, with room for a stretch; not of a
    Python law.
    """
    n = len(model.rotor)
    rate, samples = float(signals.rate), len(signals.q_ref)
    delay = float(signals.drive_delay)
    if not 0.0 <= delay < samples / rate:
        raise ExperimentError(
            f"drive_delay is {delay:g} s",
            advice=f"it lies between 0 and the {samples / rate:g} s of the run",
        )
    q_ref = _signal("q_ref", signals.q_ref, samples, n)
    dq_ref = None if signals.dq_ref is None else _signal("dq_ref", signals.dq_ref, samples, n)
    inputs = _signal("inputs", signals.inputs, samples, n)
    noise = _signal("noise", signals.noise, samples, n)
    begin = (q_ref[0], np.zeros(n)) if start is None else start
    steps = 1 if oracle is not None else steps_of_a_period(model, rate)
    limits = np.zeros((LIMITS, n))
    limits[GAIN], limits[OUTPUT] = signals.drive_gain, signals.limit
    limits[DISTANCE], limits[SPEED] = signals.bound, signals.speed_bound
    if signals.count is not None:
        limits[COUNT] = signals.count
    failure = np.zeros(1)
    controller.check(n)
    if isinstance(controller, PythonController):
        if dq_ref is None:
            dq_ref = backward_difference(q_ref, rate)
        channels = np.zeros((CHANNELS, samples, n))
        what, joint, sample, record = run_python_loop(
            model, controller, begin, rate, delay, q_ref, dq_ref, inputs, noise, limits, steps,
            oracle, channels, failure,
        )  # fmt: skip
        _check_outcome(
            what, joint, sample / rate, failure, limits, joint_names, channels[0, sample], model
        )
        yield slice(0, samples), channels, _states(model, record, samples)
        return
    law = controller.law(rate, q_ref, dq_ref).protected()
    state = initial_state(model, law, begin[0], begin[1], int(delay * rate + 1e-9))
    block = min(block, samples)
    channels = np.zeros((CHANNELS, block, n))
    on_path, loops = (
        path_arguments(model.friction, state, block, oracle),
        loops_of(model, begin[0]),
    )
    for first in range(0, samples, block):
        last = min(first + block, samples)
        what, joint, sample = run_loop(
            model, law, state, rate, delay, q_ref, inputs, noise, limits,
            steps, oracle, first, last, first, channels, failure, tangent, *on_path, loops,
        )  # fmt: skip
        place = channels[0, max(sample - first, 0)]  # of no meaning where all went well
        _check_outcome(what, joint, sample / rate, failure, limits, joint_names, place, model)
        length = last - first
        yield slice(first, last), channels[:, :length], _states(model, on_path[-1], length)


def steps_of_a_period(model: Model, rate: float) -> int:
    """Steps of the fast scheme in a sampling period, as many as freezing the rigid body asks for.

    Axes that only slide have M and h that never change, so that freezing them is exact and a single
    step serves: friction chooses its own inner steps.

    Args:
        model: the robot with its parameter values.
        rate: sampling rate [Hz].
    """
    springs = model.friction.path_index[:, 2] == SPRINGS
    if model.tree.prismatic.all() and not springs.any() and model.closed is None:
        return 1
    return max(1, int(np.ceil(1.0 / (rate * MAX_STEP) - 1e-9)))


def _states(model: Model, record: np.ndarray | None, samples: int) -> np.ndarray:
    """States of friction that remembers its path, shape (samples, states)."""
    if record is None or not record.shape[1]:
        return np.zeros((samples, 0))
    return record[:samples, model.friction.memories]


def _check_outcome(
    what: int,
    joint: int,
    time: float,
    failure: np.ndarray,
    limits: np.ndarray,
    joint_names: tuple[str, ...],
    near: np.ndarray,
    model: Model,
) -> None:
    """Raise the error of a run that ended early, ``near`` a posture of the reference."""
    value = float(failure[0])
    if what == NOT_CLOSED:
        raise LoopOpened(joint, near, joint_names, time)
    if what == INDEFINITE:
        raise MassMatrixNotPositiveDefinite(joint_names[joint], time, value)
    if what in (TOO_FAR, TOO_FAST):
        fast = what == TOO_FAST
        bound = float(limits[SPEED if fast else DISTANCE, joint])
        place = joint if model.closed is None else model.closed.table.places[joint]
        slides = bool(model.tree.prismatic[place])
        raise SimulationDiverged(joint_names[joint], time, value, bound, fast, slides)


def _signal(name: str, signal: np.ndarray | None, samples: int, joints: int) -> np.ndarray:
    """A signal as the compiled loop wants it; a single row stands for all samples."""
    if signal is None:
        return read_only(np.zeros((1, joints)))
    if np.shape(signal) not in ((samples, joints), (1, joints)):
        raise ShapeMismatch(name, np.shape(signal), (samples, joints))
    return read_only(np.ascontiguousarray(signal, dtype=float))
