"""Logs of four legs on a fixed base, simulated by MuJoCo: another simulator than pivident's.

Twelve hinges, three of each leg, follow chirps in a sampled PD loop whose torque acts after a
delay of any length. Only the reference and the encoder's counts are logged, as on a robot that
hangs in the air and measures no torque. MuJoCo steps by Runge–Kutta at 10 kHz, and its dry friction
is as hard as that step allows, so that what is identified is the physics and not the settings.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np

LEGS = ("front_left", "front_right", "hind_left", "hind_right")
JOINTS = ("abduction", "hip", "knee")
NAMES = tuple(f"{leg}_{joint}" for leg in LEGS for joint in JOINTS)

#: Gains of the PD law [N m/rad, N m s/rad].
KP, KD = 40.0, 1.0

#: Rate of the PD loop, of the log, and of MuJoCo's steps [Hz].
CONTROL_RATE, LOG_RATE, STEP_RATE = 400.0, 200.0, 10_000.0

#: What the encoder counts in [rad].
COUNT = 2.0 * np.pi / 2**14

#: Of MuJoCo's dry friction, a soft constraint: a damping of 1e6/s stops a joint within a step, and
#: the impedance is the largest that MuJoCo has. By default friction lags by 10 ms.
FRICTION_REFERENCE, FRICTION_IMPEDANCE = (-1.0, -1e6), (0.9999, 0.9999, 0.001, 0.5, 2.0)

#: The chirp of the reference: frequencies [Hz] and the time over which it begins [s].
CHIRP, BEGINNING = (0.1, 8.0), 1.0


@dataclass(frozen=True, eq=False)
class Joints:
    """What a simulator has of the joints, each (12,), and the delay of the torques."""

    armature: np.ndarray  # [kg m²]
    damping: np.ndarray  # [N m s/rad]
    frictionloss: np.ndarray  # [N m]
    bias: np.ndarray  # measured less true position [rad]
    delay: float  # [s]

    @classmethod
    def drawn(cls, rng: np.random.Generator) -> Joints:
        """Joints of a robot of this size, at random."""
        n = len(NAMES)
        return cls(
            armature=rng.uniform(0.005, 0.02, n),
            damping=rng.uniform(0.02, 0.2, n),
            frictionloss=rng.uniform(0.05, 0.3, n),
            bias=rng.uniform(-0.05, 0.05, n),
            delay=float(rng.uniform(1e-3, 8e-3)),
        )


def legs_spec(joints: Joints | None = None) -> mujoco.MjSpec:
    """The robot; without joints a description as it comes: no armature, friction or damping."""
    spec = mujoco.MjSpec()
    spec.modelname = "legs"
    spec.compiler.degree = False
    spec.option.timestep = 1.0 / STEP_RATE
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_RK4
    base = spec.worldbody.add_body(name="base", pos=[0, 0, 1])
    _body(base, 8.0, [0.0, 0.0, 0.0], [0.1, 0.2, 0.25])
    for i, leg in enumerate(LEGS):
        front, left = 1.0 - 2.0 * (i // 2), 1.0 - 2.0 * (i % 2)
        hip = base.add_body(name=f"{leg}_hip", pos=[0.2 * front, 0.05 * left, 0.0])
        _body(hip, 0.7, [-0.01 * front, 0.01 * left, 0.0], [5e-4, 9e-4, 6e-4])
        thigh = hip.add_body(name=f"{leg}_thigh", pos=[0.0, 0.08 * left, 0.0])
        _body(thigh, 1.0, [0.0, 0.02 * left, -0.06], [5e-3, 5e-3, 1e-3])
        shank = thigh.add_body(name=f"{leg}_shank", pos=[0.0, 0.0, -0.21])
        _body(shank, 0.25, [0.01, 0.0, -0.1], [2.5e-3, 2.5e-3, 5e-5])
        for body, joint, axis in zip(
            (hip, thigh, shank), JOINTS, ([1, 0, 0], [0, 1, 0], [0, 1, 0]), strict=True
        ):
            body.add_joint(name=f"{leg}_{joint}", axis=axis)
    for k, joint in enumerate(spec.joints):
        joint.solref_friction[:2] = FRICTION_REFERENCE
        joint.solimp_friction[:5] = FRICTION_IMPEDANCE
        if joints is not None:
            joint.armature = joints.armature[k]
            joint.damping[0] = joints.damping[k]
            joint.frictionloss = joints.frictionloss[k]
    return spec


def _body(body, mass: float, center: list[float], inertia: list[float]) -> None:
    body.mass, body.ipos, body.inertia = mass, center, inertia
    body.explicitinertial = True


def chirps(rng: np.random.Generator, duration: float, rate: float = CONTROL_RATE) -> np.ndarray:
    """Reference of the joints around a bent posture, shape (samples, 12) [rad]."""
    t = np.arange(round(duration * rate)) / rate
    low, high = CHIRP
    turns = low * t + (high - low) * t**2 / (2.0 * duration)
    phase = rng.uniform(0.0, 2.0 * np.pi, len(NAMES))
    amplitude = rng.uniform(0.2, 0.35, len(NAMES))
    fade = np.minimum(t / BEGINNING, 1.0)[:, None]
    posture = np.tile([0.0, 0.6, -1.2], len(LEGS))
    return posture + fade * amplitude * np.sin(2.0 * np.pi * turns[:, None] + phase)


@dataclass(frozen=True, eq=False)
class LegsLog:
    """A log at ``LOG_RATE``, and the reference at the rate of the loop."""

    q: np.ndarray  # counted positions with their bias, (samples, 12) [rad]
    q_ref: np.ndarray  # (samples, 12) [rad]
    q_command: np.ndarray  # the reference at each control sample, (control samples, 12) [rad]


def legs_log(
    joints: Joints, rng: np.random.Generator, duration: float = 20.0, counted_law: bool = True
) -> LegsLog:
    """Simulate a log.

    Args:
        joints: the truth.
        rng: of the reference.
        duration: [s].
        counted_law: whether the law reads the encoder's counts, too, and not the exact position.
    """
    model = legs_spec(joints).compile()
    data = mujoco.MjData(model)
    reference = chirps(rng, duration)
    data.qpos[:] = reference[0] - joints.bias
    steps = round(STEP_RATE / CONTROL_RATE)
    whole, part = divmod(joints.delay * STEP_RATE, 1.0)
    periods, late = divmod(int(whole), steps)
    before, torques = None, []
    q = np.empty_like(reference)
    for k in range(len(reference)):
        measured = data.qpos + joints.bias
        counted = COUNT * np.round(measured / COUNT)
        q[k] = counted
        read = counted if counted_law else measured
        before = read if before is None else before
        slope = (reference[k] - reference[max(k - 1, 0)] - read + before) * CONTROL_RATE
        torques.append(KP * (reference[k] - read) + KD * slope)
        before = read
        new, old = torques[max(k - periods, 0)], torques[max(k - periods - 1, 0)]
        if late:
            data.qfrc_applied[:] = old
            mujoco.mj_step(model, data, late)
        data.qfrc_applied[:] = part * old + (1.0 - part) * new
        mujoco.mj_step(model, data, 1)
        if steps - late - 1:
            data.qfrc_applied[:] = new
            mujoco.mj_step(model, data, steps - late - 1)
    every = round(CONTROL_RATE / LOG_RATE)
    return LegsLog(q[::every], reference[::every], reference)


def write_legs(path: Path, joints: Joints | None = None) -> Path:
    """Write the robot as MJCF."""
    spec = legs_spec(joints)
    spec.compile()
    path.write_text(spec.to_xml())
    return path
