"""The auxiliary model: reference, controller and parameters give q, dq, ddq and tau.

The digital law stays in the loop: at each control sample it reads the position, and its torque is
held over the period. Accelerations at a sample are those right after the new torque was applied.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit

from pivident.dynamics.forward import Model
from pivident.errors import MassMatrixNotPositiveDefinite, SimulationDiverged
from pivident.simulation.controllers import TAPS, Controller, PythonController
from pivident.simulation.integration import (
    advance_frozen,
    advance_runge_kutta,
    evaluate,
    make_state,
)

_DONE, _INDEFINITE, _DIVERGED = 0, 1, 2

#: Longest step over which the rigid body may be frozen [s].
LONGEST_STEP = 2.5e-4


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
    """

    rate: float
    q: np.ndarray
    dq: np.ndarray
    ddq: np.ndarray
    tau: np.ndarray
    command: np.ndarray


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


@njit(cache=True, nogil=True)
def _move(model, state, torque, period, steps, oracle, first):
    """One control period in so many steps; returns -1 or the joint of an indefinite M(q)."""
    if oracle > 0:
        return advance_runge_kutta(model, state, torque, period, oracle)
    for s in range(steps):
        if s > 0:
            joint = evaluate(model, state, torque)
            if joint >= 0:
                return joint
        advance_frozen(model, state, torque, period / steps, first and s == 0)
    return -1


@njit(cache=True, nogil=True)
def _run(
    model, law, rate, q_ref, inputs, noise, gain, limit, bound, speed_bound, start, start_speed,
    steps, oracle, q, dq, ddq, tau, command, failure,
):  # fmt: skip
    """Simulate all samples; returns (what happened, joint, sample)."""
    n, samples = q_ref.shape[1], q_ref.shape[0]
    state = make_state(model, start, start_speed)
    period = 1.0 / rate
    torque, integral = np.zeros(n), np.zeros(n)
    past = np.zeros((n, TAPS))  # inner state of B/A and W/A, direct form II
    for j in range(n):  # the loop has been at rest: the filters hold their stationary state
        total = 0.0
        for k in range(TAPS):
            total += law.pole[j, k]
        if total != 0.0:
            for k in range(TAPS):
                past[j, k] = start[j] / total
    for k in range(samples):
        for j in range(n):
            w = state.q[j] + noise[k % noise.shape[0], j]
            for m in range(1, TAPS):
                w -= law.pole[j, m] * past[j, m - 1]
            proportional, integrand = law.feedback[j, 0] * w, law.integrand[j, 0] * w
            for m in range(1, TAPS):
                proportional += law.feedback[j, m] * past[j, m - 1]
                integrand += law.integrand[j, m] * past[j, m - 1]
            for m in range(TAPS - 1, 0, -1):
                past[j, m] = past[j, m - 1]
            past[j, 0] = w
            growth = law.integral_gain[j] * period * (law.integrand_reference[k, j] - integrand)
            u = law.reference[k, j] - proportional + integral[j] + growth
            u += inputs[k % inputs.shape[0], j]
            held = min(max(u, -limit[j]), limit[j])
            # anti-windup: the integrator rests while it would push further into the limit
            if (u - held) * growth <= 0.0:
                integral[j] += growth
            command[k, j] = held
            torque[j] = gain[j] * held
        joint = evaluate(model, state, torque)
        if joint >= 0:
            failure[0] = state.mass[1, joint, joint]
            return _INDEFINITE, joint, k
        for j in range(n):
            q[k, j], dq[k, j], ddq[k, j], tau[k, j] = state.q[j], state.v[j], state.ddq[j], torque[j]
            away = abs(state.q[j] - q_ref[k, j])
            if not (away <= bound[j] and abs(state.v[j]) <= speed_bound[j]):
                failure[0] = away
                return _DIVERGED, j, k
        joint = _move(model, state, torque, period, steps, oracle, k == 0)
        if joint >= 0:
            failure[0] = state.mass[1, joint, joint]
            return _INDEFINITE, joint, k
    return _DONE, -1, -1


@njit(cache=True, nogil=True)
def _single_step(model, state, torque, period, steps, first):
    """One control period of a loop that is closed in Python."""
    joint = evaluate(model, state, torque)
    if joint >= 0:
        return joint
    return _move(model, state, torque, period, steps, 0, first)


def simulate(
    model: Model,
    controller: Controller,
    signals: LoopSignals,
    joint_names: tuple[str, ...],
    start: tuple[np.ndarray, np.ndarray] | None = None,
    oracle: int = 0,
) -> Trajectory:
    """Simulate the closed loop over all samples of the reference.

    Args:
        model: robot with parameter values, from ``make_model``.
        controller: the sampled law.
        signals: reference, known inputs, noise, gains and bounds.
        joint_names: for messages.
        start: initial positions and speeds, each (joints,); default: at rest on the reference.
        oracle: 0: the fast scheme; else Runge–Kutta 4 with so many substeps per control period.

    Returns:
        The trajectory at the control rate.

    Raises:
        SimulationDiverged: names the joint, the time and the distance from the reference.
        MassMatrixNotPositiveDefinite: names the joint, the time and the pivot.
    """
    q_ref = np.ascontiguousarray(signals.q_ref, dtype=float)
    n = q_ref.shape[1]
    if start is None:
        start = (q_ref[0].copy(), np.zeros(n))
    steps = max(1, int(np.ceil(1.0 / (signals.rate * LONGEST_STEP) - 1e-9)))
    q, dq, ddq, tau, command = (np.zeros(q_ref.shape) for _ in range(5))
    silence = np.zeros((1, n))
    inputs = silence if signals.inputs is None else np.ascontiguousarray(signals.inputs, float)
    noise = silence if signals.noise is None else np.ascontiguousarray(signals.noise, float)
    failure = np.zeros(1)
    if isinstance(controller, PythonController):
        what, joint, sample = _run_in_python(
            model, controller, signals, inputs, noise, start, steps, (q, dq, ddq, tau, command), failure
        )
    else:
        what, joint, sample = _run(
            model, controller.law(signals.rate, q_ref, signals.dq_ref), signals.rate, q_ref, inputs,
            noise, signals.drive_gain, signals.limit, signals.bound, signals.speed_bound,
            start[0], start[1], steps, oracle, q, dq, ddq, tau, command, failure,
        )  # fmt: skip
    time = sample / signals.rate
    if what == _INDEFINITE:
        raise MassMatrixNotPositiveDefinite(joint_names[joint], time, float(failure[0]))
    if what == _DIVERGED:
        bound = float(signals.bound[joint])
        raise SimulationDiverged(joint_names[joint], time, float(failure[0]), bound)
    return Trajectory(signals.rate, q, dq, ddq, tau, command)


def _run_in_python(model, controller, signals, inputs, noise, start, steps, out, failure):
    """The same loop around a law that is a Python function."""
    q, dq, ddq, tau, command = out
    q_ref = signals.q_ref
    dq_ref = signals.dq_ref
    if dq_ref is None:
        dq_ref = np.gradient(q_ref, 1.0 / signals.rate, axis=0)
    if controller.reset is not None:
        controller.reset()
    state = make_state(model, start[0], start[1])
    for k in range(len(q_ref)):
        seen = state.q + noise[k % len(noise)]
        u = np.asarray(controller.function(k, seen, q_ref[k], dq_ref[k]), dtype=float)
        command[k] = np.clip(u + inputs[k % len(inputs)], -signals.limit, signals.limit)
        tau[k] = signals.drive_gain * command[k]
        q[k], dq[k] = state.q, state.v
        away = np.abs(state.q - q_ref[k])
        inside = (away <= signals.bound) & (np.abs(state.v) <= signals.speed_bound)
        if not (inside.all() and np.isfinite(tau[k]).all()):
            joint = int(np.argmin(inside & np.isfinite(tau[k])))
            failure[0] = away[joint]
            return _DIVERGED, joint, k
        joint = _single_step(model, state, tau[k], 1.0 / signals.rate, steps, k == 0)
        if joint >= 0:
            failure[0] = state.mass[1, joint, joint]
            return _INDEFINITE, joint, k
        ddq[k] = state.ddq
    return _DONE, -1, -1
