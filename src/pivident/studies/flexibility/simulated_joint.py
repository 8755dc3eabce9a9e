"""A flexible joint in its closed loop: two inertias, a spring, friction, two encoders.

    Jm ddq_m + fv_m dq_m + fc_m s(dq_m) + o_m + T = tau
    Jl ddq_l + fv_l dq_l + fc_l s(dq_l) + o_l + g_s sin q_l + g_c cos q_l = T
    T = k (q_m - q_l) + d (dq_m - dq_l),            s(dq) = (2/π) atan(γ dq)

Everything is on the joint side: q_m is the motor's angle over the reduction, tau the motor's torque
times the reduction. Backlash and transmission error of the gear are optional.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pivident.data.recording.recording import Recording
from pivident.foundation.compiled import compiled
from pivident.foundation.errors import IdentificationError
from pivident.foundation.text.display import Displayed
from pivident.loop.simulation.closed_loop import in_whole_counts


@dataclass(frozen=True)
class TwoMassJoint(Displayed):
    """Parameters of a flexible joint, all on the joint side.

    Attributes:
        motor_inertia: Jm [kg m²].
        load_inertia: Jl [kg m²].
        stiffness: k [N m/rad].
        damping: d [N m s/rad].
        motor_viscous: fv_m [N m s/rad].
        motor_coulomb: fc_m [N m].
        motor_offset: o_m [N m].
        load_viscous: fv_l [N m s/rad].
        load_coulomb: fc_l [N m].
        load_offset: o_l [N m].
        gravity_sin: g_s [N m].
        gravity_cos: g_c [N m].
        gamma: slope γ of the smoothed sign [s/rad].
    """

    motor_inertia: float
    load_inertia: float
    stiffness: float
    damping: float
    motor_viscous: float = 0.0
    motor_coulomb: float = 0.0
    motor_offset: float = 0.0
    load_viscous: float = 0.0
    load_coulomb: float = 0.0
    load_offset: float = 0.0
    gravity_sin: float = 0.0
    gravity_cos: float = 0.0
    gamma: float = 150.0

    @property
    def antiresonance(self) -> float:
        """√(k/Jl)/2π [Hz]: the load swings against a locked motor."""
        return math.sqrt(self.stiffness / self.load_inertia) / (2 * math.pi)

    @property
    def resonance(self) -> float:
        """√(k (1/Jm + 1/Jl))/2π [Hz]: motor and load swing against each other."""
        return self.antiresonance * math.sqrt(1 + self.load_inertia / self.motor_inertia)

    def numbers(self) -> np.ndarray:
        """The parameters in the order of the equations, for the kernel, shape (13,)."""
        return np.array(
            [
                *(self.motor_inertia, self.motor_viscous, self.motor_coulomb, self.motor_offset),
                *(self.load_inertia, self.load_viscous, self.load_coulomb, self.load_offset),
                *(self.stiffness, self.damping, self.gravity_sin, self.gravity_cos, self.gamma),
            ]
        )


@dataclass(frozen=True)
class GearFaults:
    """Backlash and transmission error of a gear."""

    backlash: float = 0.0  # width of the gap without torque [rad]
    # transmission error ε sin(order N q_m) that the gear adds to q_m [rad]
    error_amplitude: float = 0.0
    error_order: float = 0.0  # cycles per revolution of the motor
    reduction: float = 1.0  # N, motor revolutions per revolution of the joint


@dataclass(frozen=True)
class MotorLoop:
    """PD law on the motor's encoder, with feed-forward.

        tau = kp (q_ref - q_m) + kd (dq_ref - dq_m) + feed_forward ddq_ref

    dq_m is the backward difference of the encoder through a first-order lag.
    """

    kp: float  # [N m/rad]
    kd: float  # [N m s/rad]
    feed_forward: float = 0.0  # inertia of the feed-forward [kg m²]
    lag: float = 0.0  # time constant of the speed's filter [s]


@dataclass(frozen=True)
class Sensors:
    """Noise (standard deviations) and steps of encoders and torque sensor."""

    motor_step: float = 0.0  # step of the motor encoder, on the joint side [rad]; 0: none
    link_step: float = 0.0  # step of the link encoder [rad]; 0: none
    motor_noise: float = 0.0  # white noise of the motor encoder [rad]
    link_noise: float = 0.0  # white noise of the link encoder [rad]
    torque_noise: float = 0.0  # white noise of the logged torque [N m]
    link_lag: int = 0  # delay of the link encoder in whole samples


def simulate_joint(
    joint: TwoMassJoint,
    loop: MotorLoop,
    q_ref: np.ndarray,
    rate: float,
    *,
    sensors: Sensors | None = None,
    gear: GearFaults | None = None,
    seed: int = 0,
    steps: int = 10,
    name: str = "two_mass_joint",
) -> Recording:
    """Record a simulated joint: both encoders, torque and reference.

    The torque is held over a sample; the equations of motion are integrated by Runge-Kutta's
    fourth-order formula with several steps per sample.

    Args:
        joint: the parameters.
        loop: the control law; it reads the motor encoder with its step and noise.
        q_ref: reference, shape (samples,) [rad].
        rate: sampling and control rate [Hz].
        sensors: steps and noise; None: ideal.
        gear: backlash and transmission error; None: neither.
        seed: seed of the noise.
        steps: integration steps per sample.
        name: name of the recording.

    Returns:
        The recording.

    Raises:
        IdentificationError: the loop is unstable.
    """
    sensors, gear = sensors or Sensors(), gear or GearFaults()
    rng = np.random.default_rng(seed)
    samples = len(q_ref)
    noise = rng.standard_normal((3, samples))
    q_ref = np.asarray(q_ref, dtype=float)
    motion = loop_motion(
        joint,
        loop,
        q_ref,
        rate,
        sensors.motor_noise * noise[0],
        sensors.motor_step,
        gear,
        steps,
    )
    link = _delayed(motion[1], sensors.link_lag) + sensors.link_noise * noise[1]
    return Recording(
        name,
        ("joint_1",),
        motion[3][:, None],
        (motion[2] + sensors.torque_noise * noise[2])[:, None],
        rate,
        q_ref=q_ref[:, None],
        q_link=in_whole_counts(link[:, None], sensors.link_step),
    )


def loop_motion(
    joint: TwoMassJoint,
    loop: MotorLoop,
    q_ref: np.ndarray,
    rate: float,
    motor_noise: np.ndarray | None = None,
    motor_step: float = 0.0,
    gear: GearFaults | None = None,
    steps: int = 4,
) -> np.ndarray:
    """True q_m, q_l [rad], torque [N m] and the encoder's q_m [rad], (4, samples).

    ``motor_noise`` and ``motor_step`` are those of the motor encoder [rad], ``steps`` the
    integration steps per sample.
    """
    gear = gear or GearFaults()
    noise = np.zeros(len(q_ref)) if motor_noise is None else motor_noise
    speed = np.gradient(q_ref, 1 / rate)
    forward = loop.feed_forward * np.gradient(speed, 1 / rate)
    law = np.array([loop.kp, loop.kd, loop.lag])
    faults = np.array(
        [gear.backlash, gear.error_amplitude, gear.error_order * gear.reduction], dtype=float
    )
    out = np.empty((4, len(q_ref)))
    rest = _rest_deflection(joint, float(q_ref[0]))
    _run(
        joint.numbers(),
        law,
        faults,
        q_ref,
        speed,
        forward,
        noise,
        motor_step,
        rate,
        steps,
        rest,
        out,
    )
    if not np.isfinite(out).all() or np.abs(out[:2]).max() > 1e3 * (1 + np.abs(q_ref).max()):
        raise IdentificationError(
            f"the simulated loop with kp = {loop.kp:.4g} N m/rad and kd = {loop.kd:.4g} N m s/rad "
            "is unstable",
            advice="lower the gains or raise the rate",
        )
    return out


def _rest_deflection(joint: TwoMassJoint, q: float) -> float:
    """Deflection under the load's weight at standstill [rad]."""
    weight = joint.gravity_sin * math.sin(q) + joint.gravity_cos * math.cos(q) + joint.load_offset
    return weight / joint.stiffness


def _delayed(x: np.ndarray, samples: int) -> np.ndarray:
    """A signal delayed by whole samples, its first value repeated."""
    return np.concatenate([np.full(samples, x[0]), x[: len(x) - samples]])


@compiled()
def _accelerations(numbers, faults, qm, vm, ql, vl, tau):
    """Accelerations of motor and load."""
    jm, fvm, fcm, om, jl, fvl, fcl, ol, k, d, gs, gc, gamma = numbers
    backlash, amplitude, cycles = faults
    deflection = qm - ql
    rate = vm - vl
    if amplitude != 0.0:
        deflection += amplitude * math.sin(cycles * qm)
        rate += amplitude * cycles * math.cos(cycles * qm) * vm
    half = 0.5 * backlash
    if deflection > half:
        torque = k * (deflection - half) + d * rate
    elif deflection < -half:
        torque = k * (deflection + half) + d * rate
    else:
        torque = 0.0
    sign = 2.0 / math.pi
    am = (tau - fvm * vm - fcm * sign * math.atan(gamma * vm) - om - torque) / jm
    weight = gs * math.sin(ql) + gc * math.cos(ql)
    al = (torque - fvl * vl - fcl * sign * math.atan(gamma * vl) - ol - weight) / jl
    return am, al


@compiled()
def _run(numbers, law, faults, q_ref, dq_ref, forward, noise, step, rate, steps, rest, out):
    """The loop: read, command, integrate."""
    kp, kd, lag = law
    dt = 1.0 / rate
    h = dt / steps
    qm, vm, ql, vl = q_ref[0], 0.0, q_ref[0] - rest, 0.0
    last, speed = 0.0, 0.0
    for i in range(len(q_ref)):
        read = qm + noise[i]
        if step > 0.0:
            read = round(read / step) * step
        if i == 0:
            last = read
        speed += (1.0 if lag <= 0.0 else dt / (lag + dt)) * ((read - last) * rate - speed)
        last = read
        tau = kp * (q_ref[i] - read) + kd * (dq_ref[i] - speed) + forward[i]
        out[0, i], out[1, i], out[2, i], out[3, i] = qm, ql, tau, read
        for _ in range(steps):
            a1, b1 = _accelerations(numbers, faults, qm, vm, ql, vl, tau)
            u2, w2 = vm + 0.5 * h * a1, vl + 0.5 * h * b1
            a2, b2 = _accelerations(
                numbers, faults, qm + 0.5 * h * vm, u2, ql + 0.5 * h * vl, w2, tau
            )
            u3, w3 = vm + 0.5 * h * a2, vl + 0.5 * h * b2
            a3, b3 = _accelerations(
                numbers, faults, qm + 0.5 * h * u2, u3, ql + 0.5 * h * w2, w3, tau
            )
            u4, w4 = vm + h * a3, vl + h * b3
            a4, b4 = _accelerations(numbers, faults, qm + h * u3, u4, ql + h * w3, w4, tau)
            qm += h / 6.0 * (vm + 2.0 * u2 + 2.0 * u3 + u4)
            ql += h / 6.0 * (vl + 2.0 * w2 + 2.0 * w3 + w4)
            vm += h / 6.0 * (a1 + 2.0 * a2 + 2.0 * a3 + a4)
            vl += h / 6.0 * (b1 + 2.0 * b2 + 2.0 * b3 + b4)
