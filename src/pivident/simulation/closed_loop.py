"""The auxiliary model: reference, controller and parameters give q, dq, ddq and tau.

The digital law stays in the loop: at each control sample it reads the position, and its torque is
held over the period. Accelerations at a sample are those right after the new torque was applied.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from pivident.compiled import read_only
from pivident.dynamics.forward import Model
from pivident.errors import (
    ExperimentError,
    MassMatrixNotPositiveDefinite,
    ShapeMismatch,
    SimulationDiverged,
)
from pivident.simulation.controllers import Controller, PythonController, backward_difference
from pivident.simulation.loop_kernel import (
    CHANNELS,
    DISTANCE,
    GAIN,
    INDEFINITE,
    OUTPUT,
    SPEED,
    TOO_FAR,
    TOO_FAST,
    initial_state,
    path_arguments,
    run_loop,
)
from pivident.simulation.python_loop import run_python_loop

#: Samples that are simulated at a time where a run is taken in stretches.
BLOCK = 16384

#: Longest step over which the rigid body may be frozen [s].
MAX_STEP = 2.5e-4


@dataclass(frozen=True, eq=False)
class Trajectory:
    """A simulated motion; all arrays (samples, joints).

    Attributes:
        rate: samples per second [Hz].
        q: positions [rad or m].
        dq: speeds [rad/s or m/s].
        ddq: accelerations, right after each sample's torque [rad/s² or m/s²].
        tau: joint torques or forces, held from each sample on [N m or N].
        command: controller output after saturation [unit of the controller].
        friction_states: states z of friction that remembers its path, in the order of
            ``dynamics.forward.friction_states``, shape (samples, states).
    """

    rate: float
    q: np.ndarray
    dq: np.ndarray
    ddq: np.ndarray
    tau: np.ndarray
    command: np.ndarray
    friction_states: np.ndarray


@dataclass(frozen=True, eq=False)
class LoopSignals:
    """What drives a simulated loop, sampled at the control rate; arrays (samples, joints).

    Attributes:
        rate: control rate [Hz].
        q_ref: reference positions [rad or m].
        dq_ref: reference speeds, or None: the law takes differences where it needs them.
        inputs: known inputs added to the controller's output [unit of the controller].
        noise: encoder noise added to the position that the controller reads [rad or m].
        drive_gain: joint torque per controller output, shape (joints,).
        limit: largest controller output, shape (joints,); infinite where there is none.
        bound: largest distance from the reference before the run counts as diverged [rad or m],
            shape (joints,).
        speed_bound: largest speed before the run counts as diverged, shape (joints,).
        drive_delay: time from a sample until the torque that answers it acts [s].
    """

    rate: float
    q_ref: np.ndarray
    dq_ref: np.ndarray | None
    inputs: np.ndarray | None
    noise: np.ndarray | None
    drive_gain: np.ndarray
    limit: np.ndarray
    bound: np.ndarray
    speed_bound: np.ndarray
    drive_delay: float = 0.0


def simulate(
    model: Model,
    controller: Controller,
    signals: LoopSignals,
    joint_names: tuple[str, ...],
    start: tuple[np.ndarray, np.ndarray] | None = None,
    oracle: int | None = None,
) -> Trajectory:
    """Simulate the closed loop over all samples of the reference.

    Args:
        model: robot with parameter values, from ``make_model``.
        controller: the sampled law, or a Python function (then at the speed of Python).
        signals: reference, known inputs, noise, gains and bounds.
        joint_names: for messages.
        start: initial positions and speeds, each (joints,); default: at rest on the reference.
        oracle: None: the fast scheme; else Runge–Kutta 4 with so many substeps per control period.

    Returns:
        The trajectory at the control rate.

    Raises:
        SimulationDiverged: names the joint, the time and the distance from the reference.
        MassMatrixNotPositiveDefinite: names the joint, the time and the pivot.
        ShapeMismatch: signals that do not belong together.
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
) -> Iterator[tuple[slice, np.ndarray, np.ndarray]]:
    """Simulate a stretch at a time, so that a long run needs no memory for all of its channels.

    Args:
        model: see :func:`simulate`; likewise the next five.
        controller: the sampled law. A Python function is simulated in one stretch.
        signals: reference, known inputs, noise, gains and bounds.
        joint_names: for messages.
        start: initial positions and speeds.
        oracle: see :func:`simulate`.
        block: samples of a stretch.

    Yields:
        The samples, the channels q, dq, ddq, tau and command on them, shape
        (5, stretch, joints), and the states of friction, shape (stretch, states). The next
        stretch overwrites both.

    Raises:
        SimulationDiverged: see :func:`simulate`; likewise the others.
        MassMatrixNotPositiveDefinite: M(q) is indefinite on the way.
        ShapeMismatch: signals that do not belong together.
    """
    n = len(model.inertia)
    rate, samples = float(signals.rate), len(signals.q_ref)
    delay = float(signals.drive_delay)
    if not 0.0 <= delay < samples / rate:
        raise ExperimentError(
            f"drive_delay is {delay:g} s; it lies between 0 and the {samples / rate:g} s of the run"
        )
    q_ref = _signal("q_ref", signals.q_ref, samples, n)
    dq_ref = None if signals.dq_ref is None else _signal("dq_ref", signals.dq_ref, samples, n)
    inputs = _signal("inputs", signals.inputs, samples, n)
    noise = _signal("noise", signals.noise, samples, n)
    begin = (q_ref[0], np.zeros(n)) if start is None else start
    steps = max(1, int(np.ceil(1.0 / (rate * MAX_STEP) - 1e-9))) if oracle is None else 1
    limits = np.empty((4, n))
    limits[GAIN], limits[OUTPUT] = signals.drive_gain, signals.limit
    limits[DISTANCE], limits[SPEED] = signals.bound, signals.speed_bound
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
        _check_outcome(what, joint, sample / rate, float(failure[0]), limits, joint_names)
        yield slice(0, samples), channels, _states(model, record, samples)
        return
    law = controller.law(rate, q_ref, dq_ref).protected()
    state = initial_state(model, law, begin[0], begin[1], int(delay * rate + 1e-9))
    block = min(block, samples)
    channels = np.zeros((CHANNELS, block, n))
    on_path = path_arguments(model.friction, state, block)
    for first in range(0, samples, block):
        last = min(first + block, samples)
        what, joint, sample = run_loop(
            model, law, state, rate, delay, q_ref, inputs, noise, limits,
            steps, oracle, first, last, first, channels, failure, *on_path,
        )  # fmt: skip
        _check_outcome(what, joint, sample / rate, float(failure[0]), limits, joint_names)
        length = last - first
        yield slice(first, last), channels[:, :length], _states(model, on_path[-1], length)


def _states(model: Model, record: np.ndarray | None, samples: int) -> np.ndarray:
    """States of friction that remembers its path, shape (samples, states)."""
    if record is None:
        return np.zeros((samples, 0))
    return record[:samples, model.friction.memories]


def _check_outcome(
    what: int,
    joint: int,
    time: float,
    value: float,
    limits: np.ndarray,
    joint_names: tuple[str, ...],
) -> None:
    """Raise the error of a run that ended early."""
    if what == INDEFINITE:
        raise MassMatrixNotPositiveDefinite(joint_names[joint], time, value)
    if what in (TOO_FAR, TOO_FAST):
        fast = what == TOO_FAST
        bound = float(limits[SPEED if fast else DISTANCE, joint])
        raise SimulationDiverged(joint_names[joint], time, value, bound, speed=fast)


def _signal(name: str, signal: np.ndarray | None, samples: int, joints: int) -> np.ndarray:
    """A signal as the compiled loop wants it; a single row of zeros where there is none."""
    if signal is None:
        return read_only(np.zeros((1, joints)))
    if np.shape(signal) != (samples, joints):
        raise ShapeMismatch(name, np.shape(signal), (samples, joints))
    return read_only(np.ascontiguousarray(signal, dtype=float))
