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
from pivident.simulation.controllers import TAPS, Controller
from pivident.simulation.integration import (
    DDQ,
    FACTOR,
    LAYERS,
    ROWS,
    Q,
    V,
    advance,
    advance_runge_kutta,
    dry_friction_level,
    evaluate,
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


@njit(cache=True, nogil=True, error_model="numpy")
def _run(
    model, law, rate, q_ref, inputs, noise, gain, limit, bound, speed_bound, start, start_speed,
    steps, oracle, q, dq, ddq, tau, command, failure,
):  # fmt: skip
    """Simulate all samples; returns (what happened, joint, sample)."""
    n, samples = q_ref.shape[1], q_ref.shape[0]
    period = 1.0 / rate
    tree, friction = model.tree, model.friction
    parent, prismatic, rotation = tree.parent, tree.prismatic, tree.rotation
    translation, gravity, inertia, rotor = (
        tree.translation,
        tree.gravity,
        model.inertia,
        model.rotor,
    )
    linear, term_index, term_value = friction.linear, friction.term_index, friction.term_value
    pair_index, pair_value = friction.pair_index, friction.pair_value
    feedback, pole, integrand = law.feedback, law.pole, law.integrand
    integral_gain, reference = law.integral_gain, law.reference
    integrand_reference = law.integrand_reference
    vectors, matrices = np.zeros((ROWS, n)), np.zeros((LAYERS, n, n))
    slopes, clock = np.zeros((2, n + pair_index.shape[0])), np.zeros(4)
    pose, motion, force, composite = (
        np.zeros((n, 12)), np.zeros((n, 9)), np.zeros((n, 6)), np.zeros((n, 10)),
    )  # fmt: skip
    torque, integral = np.zeros(n), np.zeros(n)
    vectors[Q], vectors[V] = start, start_speed
    dry_friction_level(term_index, term_value, pair_index, pair_value, vectors)
    past = np.zeros((n, TAPS))  # inner state of B/A and W/A, direct form II
    for j in range(n):  # the loop has been at rest: the filters hold their stationary state
        total = pole[j].sum()
        if total != 0.0:
            past[j] = start[j] / total
    heard = 0  # row of noise and of inputs; a single row stands for all samples
    given = 0
    for k in range(samples):
        if noise.shape[0] > 1:
            heard = k
        if inputs.shape[0] > 1:
            given = k
        for j in range(n):
            w = vectors[Q, j] + noise[heard, j]
            for m in range(1, TAPS):
                w -= pole[j, m] * past[j, m - 1]
            proportional, integrated = feedback[j, 0] * w, integrand[j, 0] * w
            for m in range(1, TAPS):
                proportional += feedback[j, m] * past[j, m - 1]
                integrated += integrand[j, m] * past[j, m - 1]
            for m in range(TAPS - 1, 0, -1):
                past[j, m] = past[j, m - 1]
            past[j, 0] = w
            growth = integral_gain[j] * period * (integrand_reference[k, j] - integrated)
            u = reference[k, j] - proportional + integral[j] + growth + inputs[given, j]
            held = min(max(u, -limit[j]), limit[j])
            # anti-windup: the integrator rests while it would push further into the limit
            if (u - held) * growth <= 0.0:
                integral[j] += growth
            command[k, j] = held
            torque[j] = gain[j] * held
        for s in range(steps):
            joint = evaluate(
                parent, prismatic, rotation, translation, gravity, inertia, rotor,
                linear, term_index, term_value, pair_index, pair_value,
                vectors, matrices, slopes, clock, pose, motion, force, composite, torque,
                oracle > 0,
            )  # fmt: skip
            if joint >= 0:
                failure[0] = matrices[FACTOR, joint, joint]
                return _INDEFINITE, joint, k
            if s == 0:
                for j in range(n):
                    q[k, j], dq[k, j], ddq[k, j] = vectors[Q, j], vectors[V, j], vectors[DDQ, j]
                    tau[k, j] = torque[j]
                    away = abs(vectors[Q, j] - q_ref[k, j])
                    if not (away <= bound[j] and abs(vectors[V, j]) <= speed_bound[j]):
                        failure[0] = away
                        return _DIVERGED, j, k
            if oracle > 0:
                joint = advance_runge_kutta(
                    parent, prismatic, rotation, translation, gravity, inertia, rotor,
                    linear, term_index, term_value, pair_index, pair_value,
                    vectors, matrices, slopes, clock, pose, motion, force, composite, torque,
                    period, oracle,
                )  # fmt: skip
                if joint >= 0:
                    failure[0] = matrices[FACTOR, joint, joint]
                    return _INDEFINITE, joint, k
                break
            advance(
                linear, term_index, term_value, pair_index, pair_value,
                vectors, matrices, slopes, clock, torque, period / steps,
            )  # fmt: skip
    return _DONE, -1, -1


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
    law = controller.law(signals.rate, q_ref, signals.dq_ref)
    what, joint, sample = _run(
        model, law, signals.rate, q_ref, inputs, noise, signals.drive_gain, signals.limit,
        signals.bound, signals.speed_bound, start[0], start[1], steps, oracle,
        q, dq, ddq, tau, command, failure,
    )  # fmt: skip
    time = sample / signals.rate
    if what == _INDEFINITE:
        raise MassMatrixNotPositiveDefinite(joint_names[joint], time, float(failure[0]))
    if what == _DIVERGED:
        bound = float(signals.bound[joint])
        raise SimulationDiverged(joint_names[joint], time, float(failure[0]), bound)
    return Trajectory(signals.rate, q, dq, ddq, tau, command)
