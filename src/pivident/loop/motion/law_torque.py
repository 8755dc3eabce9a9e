"""The torque of a log that holds none: what the known control law commands at its positions.

    u_k = r_k - B(z)/A(z) q_k + I_k + g(q_k) + inputs_k,    τ_k = gain · clip(u_k, ±limit)
    I_k = I_{k-1} + K_i h (w_k - W(z)/A(z) q_k),            I_{-1} = 0

The same law as in the simulated loop (`pivident.loop.simulation.controllers`), with the recorded
position in the place of the simulated one. Before the first sample the joint has been at rest.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pivident.data.logs.torque_scale import OUTPUT, OUTPUT_UNIT, TorqueScale
from pivident.data.recording.recording import Recording
from pivident.dynamics.parameters import nominal_values, standard_parameters
from pivident.foundation.errors import ExperimentError
from pivident.loop.motion.motion import central_differences
from pivident.loop.simulation.control_loop import (
    Loop,
    computed_torque_feed_forward,
    gravity_feed_forward,
    with_measured_gravity,
)
from pivident.loop.simulation.controllers import (
    Controller,
    PythonController,
    SampledLaw,
    backward_difference,
)
from pivident.loop.simulation.gravity_compensation import GravityModel
from pivident.robot.description import Robot
from pivident.signals.cubic_spline import cubic_spline

#: What to do where the law that was active is not known.
_NEXT_STEP = (
    "map the column of tau, or give the control law that was active: [controller] with type, gains "
    "and drive_gain, and the column of q_ref"
)


def with_law_torque(robot: Robot, loop: Loop | None, recording: Recording) -> Recording:
    """A recording without torque with that of its control law.

    Args:
        robot: the robot, whose nominal parameters a feed-forward has.
        loop: the control loop; None: it is not known.
        recording: one run; returned as it is where it has a torque already.

    Returns:
        The recording with ``tau`` by the law, ``torque_source = "law"``.

    Raises:
        ExperimentError: the law or its reference is not known, or it commands nothing.
    """
    if recording.torque_source != "none":
        return recording
    missing = _missing(loop, recording)
    if missing:
        raise ExperimentError(f"recording {recording.name!r} has no torque, and {missing}")
    assert loop is not None and recording.q_ref is not None, "nothing is missing"
    tau = commanded_torque(robot, loop, recording)
    for j in np.flatnonzero(np.ptp(tau, axis=0) == 0.0):
        raise ExperimentError(
            f"recording {recording.name!r} has no torque, and the control law commands "
            f"{tau[0, j]:.4g} to {recording.joint_names[j]} at every sample: its reference is the "
            "measured position, or its gains are zero",
            advice="map the reference that the controller was given to q_ref, and check the gains",
        )
    output = tuple(TorqueScale(name, OUTPUT_UNIT, OUTPUT) for name in recording.joint_names)
    return replace(
        recording,
        tau=tau,
        torque_source="law",
        torque_timing="held",
        delay=0.0,
        torque_scale=() if loop.gain_known else output,
        notes=(*recording.notes, *_other_rate(recording)),
    )


def _missing(loop: Loop | None, recording: Recording) -> str:
    """What the torque cannot be computed without, and the next step; empty where it can."""
    if recording.torque_side == "link":
        return (
            "a control law commands the motors, not the sensors behind the gears of "
            'torque_side = "link"; map the column of tau, or remove torque_side'
        )
    if loop is None:
        return f"no control law is known from which it would follow; {_NEXT_STEP}"
    if loop.reference != "recorded":
        return f"the control law is a virtual one that commanded nothing; {_NEXT_STEP}"
    if recording.q_ref is None:
        return f"no reference q_ref for the control law; {_NEXT_STEP}"
    if loop.feed_forward != "none" and not loop.gain_known:
        return (
            f"its law feeds forward {loop.feed_forward}, a torque in N m, beside an output whose "
            "drive gain is not known; give drive_gain"
        )
    return ""


def _other_rate(recording: Recording) -> tuple[str, ...]:
    """That the law read other samples than the machine's."""
    rate, control_rate = recording.rate, recording.control_rate
    if abs(rate - control_rate) <= 1e-6 * rate:
        return ()
    if rate < control_rate:
        return (
            f"The control law was evaluated at the {control_rate:.6g} Hz of the control loop, "
            f"between the {rate:.6g} Hz of the log on cubic splines through positions and "
            "references.",
        )
    return (
        f"The control law was evaluated at the {rate:.6g} Hz of the log, in place of the "
        f"{control_rate:.6g} Hz of the control loop: its derivative and its integrator differ from "
        "those of the machine.",
    )


def commanded_torque(robot: Robot, loop: Loop, recording: Recording) -> np.ndarray:
    """The torque that a law commands at recorded positions, at the instants of the record.

    A log that is slower than the control loop is interpolated: a backward difference over a longer
    period would come later.

    Args:
        robot: the robot, whose nominal parameters a feed-forward has.
        loop: the control loop.
        recording: one run with its reference.

    Returns:
        Joint torques, shape (samples, joints) [N m or N].

    Raises:
        ExperimentError: a gain of the law does not fit the robot.
    """
    from pivident.loop.simulation.closed_loop import in_whole_counts

    assert recording.q_ref is not None, "the caller has looked"
    n, q_ref, dq_ref = recording.joints, recording.q_ref, recording.dq_ref
    logged, rate = recording.rate, max(recording.rate, recording.control_rate)
    gain, limit = (
        np.broadcast_to(np.asarray(x, float), (n,)) for x in (loop.drive_gain, loop.limit)
    )
    controller = with_measured_gravity(loop.controller, robot, gain, loop.feed_forward)
    controller.check(n)
    inputs = known_inputs(robot, loop, recording, q_ref, dq_ref)
    q = in_whole_counts(upsampled(recording.q, logged, rate), loop.counts(n))
    q_ref = upsampled(q_ref, logged, rate)
    dq_ref = None if dq_ref is None else upsampled(dq_ref, logged, rate)
    added = np.zeros(q.shape) if inputs is None else held(inputs, logged, rate)
    output = controller_outputs(robot, controller, q, q_ref, dq_ref, added, limit, rate)
    return gain * held(output, rate, logged)[: recording.samples]


def controller_outputs(
    robot: Robot,
    controller: Controller,
    q: np.ndarray,
    q_ref: np.ndarray,
    dq_ref: np.ndarray | None,
    added: np.ndarray,
    limit: np.ndarray,
    rate: float,
) -> np.ndarray:
    """Outputs of a controller at given positions, whatever its kind.

    Args:
        robot: the robot, whose gravity the law may compensate.
        controller: the control law.
        q: positions that it reads, shape (samples, joints) [rad or m].
        q_ref: reference positions, likewise.
        dq_ref: reference speeds, likewise [rad/s or m/s]; None: the law takes differences.
        added: known inputs, shape (samples, joints) [unit of the output].
        limit: largest output, shape (joints,).
        rate: rate of the law [Hz].

    Returns:
        Limited outputs, shape (samples, joints) [unit of the output].
    """
    if isinstance(controller, PythonController):
        return np.clip(_python_outputs(controller, q, q_ref, dq_ref, rate) + added, -limit, limit)
    law = controller.law(rate, q_ref, dq_ref)
    if len(law.masses):
        added = added + GravityModel(robot, law.masses).torque(q)
    return law_outputs(law, q, added, limit, rate)


def law_outputs(
    law: SampledLaw, q: np.ndarray, added: np.ndarray, limit: np.ndarray, rate: float
) -> np.ndarray:
    """Outputs of a sampled law at given positions.

    Args:
        law: the law, discretised at ``rate``.
        q: positions that it reads, shape (samples, joints) [rad or m].
        added: known inputs and gravity, shape (samples, joints) [unit of the output].
        limit: largest output, shape (joints,).
        rate: rate of the law [Hz].

    Returns:
        Limited outputs, shape (samples, joints) [unit of the output].
    """
    outputs = np.empty(q.shape)
    for j in range(q.shape[1]):
        pole = law.pole[j]
        free = law.reference[:, j] - _from_rest(law.feedback[j], pole, q[:, j]) + added[:, j]
        read = _from_rest(law.integrand[j], pole, q[:, j])
        growth = law.integral_gain[j] / rate * (law.integrand_reference[:, j] - read)
        outputs[:, j] = _integrated(free, growth, float(limit[j]))
    return outputs


def _from_rest(numerator: np.ndarray, pole: np.ndarray, x: np.ndarray) -> np.ndarray:
    """B(z)/A(z) x_k of a signal that stood at x_0 before."""
    from scipy.signal import lfilter, lfilter_zi

    start = lfilter_zi(numerator, pole) * x[0] if pole.sum() != 0.0 else np.zeros(len(pole) - 1)
    return lfilter(numerator, pole, x, zi=start)[0]


def _integrated(free: np.ndarray, growth: np.ndarray, limit: float) -> np.ndarray:
    """clip(free + I), where I rests while it would push further into the limit."""
    if not np.isfinite(limit) or not growth.any():
        return np.clip(free + np.cumsum(growth), -limit, limit)
    held, integral = np.empty_like(free), 0.0
    for k, (own, step) in enumerate(zip(free.tolist(), growth.tolist(), strict=True)):
        wanted = own + integral + step
        held[k] = min(max(wanted, -limit), limit)
        if (wanted - held[k]) * step <= 0.0:
            integral += step
    return held


def _python_outputs(
    controller: PythonController,
    q: np.ndarray,
    q_ref: np.ndarray,
    dq_ref: np.ndarray | None,
    rate: float,
) -> np.ndarray:
    """Outputs of a law that is a Python function, called once for each sample."""
    if controller.reset is not None:
        controller.reset()
    dq = backward_difference(q_ref, rate) if dq_ref is None else dq_ref
    said = [controller.function(k, q[k], q_ref[k], dq[k]) for k in range(len(q))]
    outputs = np.asarray(said, dtype=float)
    if outputs.shape != q.shape or not np.isfinite(outputs).all():
        raise ExperimentError(
            f"the Python control law must return {q.shape[1]} finite numbers at every sample, one "
            "for each joint"
        )
    return outputs


def known_inputs(
    robot: Robot,
    loop: Loop,
    recording: Recording,
    q_ref: np.ndarray,
    dq_ref: np.ndarray | None,
) -> np.ndarray | None:
    """What is added to a law's output beside its feedback: logged inputs and feed-forward.

    Args:
        robot: the robot, whose nominal parameters a feed-forward has.
        loop: the control loop.
        recording: one run with its inputs.
        q_ref: reference positions, shape (samples, joints) [rad or m].
        dq_ref: reference speeds, shape (samples, joints) [rad/s or m/s], or None.

    Returns:
        The inputs, shape (samples, joints) [unit of the output], or None where there are none.
    """
    inputs = np.sum(list(recording.inputs.values()), axis=0) if recording.inputs else None
    if loop.feed_forward not in ("gravity", "computed_torque"):
        return inputs
    standard = standard_parameters(robot)
    theta = nominal_values(robot, standard)
    if loop.feed_forward == "gravity":
        torque = gravity_feed_forward(robot, standard, theta, q_ref)
    else:
        dq, ddq = central_differences(q_ref, recording.rate)
        dq = dq if dq_ref is None else dq_ref
        ddq = ddq if recording.ddq_ref is None else recording.ddq_ref
        torque = computed_torque_feed_forward(robot, standard, theta, q_ref, dq, ddq)
    fed = torque / np.broadcast_to(np.asarray(loop.drive_gain, float), (recording.joints,))
    return fed if inputs is None else inputs + fed


def upsampled(x: np.ndarray, rate: float, wanted: float) -> np.ndarray:
    """A smooth signal at a higher rate, by cubic splines.

    Args:
        x: the signal, shape (samples, joints).
        rate: its rate [Hz].
        wanted: the higher rate [Hz].
    """
    if abs(rate - wanted) < 1e-9 * rate:
        return x
    t = np.arange(len(x)) / rate
    return cubic_spline(t, x)(np.arange(int(t[-1] * wanted + 1e-6) + 1) / wanted)


def held(x: np.ndarray, rate: float, wanted: float) -> np.ndarray:
    """A signal at another rate, held between its samples.

    Args:
        x: the signal, shape (samples, joints).
        rate: its rate [Hz].
        wanted: the other rate [Hz].
    """
    if abs(rate - wanted) < 1e-9 * rate:
        return x
    times = np.arange(int((len(x) - 1) / rate * wanted + 1e-6) + 1) / wanted
    return x[np.minimum((times * rate + 1e-6).astype(int), len(x) - 1)]
