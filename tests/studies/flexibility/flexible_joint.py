"""One flexible joint in its loop, with and without excitation of its resonance."""

from functools import cache

import numpy as np

from pivident.studies.flexibility.simulated_joint import (
    MotorLoop,
    Sensors,
    TwoMassJoint,
    simulate_joint,
)

RATE = 1000.0

JOINT = TwoMassJoint(
    motor_inertia=60.0,
    load_inertia=90.0,
    stiffness=2e5,
    damping=150.0,
    motor_viscous=40.0,
    motor_coulomb=60.0,
    load_viscous=20.0,
    load_coulomb=30.0,
)

#: The law that simulates instruments is fitted; this one has a filter that the fitted one lacks.
LOOP = MotorLoop(kp=6e4, kd=4e3, feed_forward=120.0, lag=2e-3)

COARSE = Sensors(
    motor_step=2e-5, link_step=1e-4, motor_noise=2e-5, link_noise=5e-5, torque_noise=30.0
)


def smooth_motion(duration=10.0):
    """Two slow sines, from rest to rest."""
    t = np.arange(int(duration * RATE)) / RATE
    ramp = np.clip(np.minimum(t, duration - t) / 2.0, 0, 1)
    ramp = ramp**4 * (35 - 84 * ramp + 70 * ramp**2 - 20 * ramp**3)
    return ramp * (0.6 * np.sin(2 * np.pi * 0.2 * t) + 0.3 * np.sin(2 * np.pi * 0.5 * t + 1))


@cache  # read only
def multisine(top, duration=10.0, seed=0):
    """Sines of random phase on every tenth of a hertz."""
    t = np.arange(int(duration * RATE)) / RATE
    rng = np.random.default_rng(seed)
    ramp = np.clip(np.minimum(t, duration - t) / 0.5, 0, 1)
    lines = np.arange(0.1, top, 0.1)
    phases = rng.uniform(0, 2 * np.pi, len(lines))
    sines = 2e-3 / (1 + lines / 3) * np.sin(2 * np.pi * np.outer(t, lines) + phases)
    return ramp**2 * (3 - 2 * ramp) * sines.sum(axis=1)


def record(seed, top=30.0, sensors=COARSE, joint=JOINT, loop=LOOP, **options):
    q_ref = smooth_motion() + (multisine(top) if top else 0.0)
    return simulate_joint(joint, loop, q_ref, RATE, sensors=sensors, seed=seed, **options)
