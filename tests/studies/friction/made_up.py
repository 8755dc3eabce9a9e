"""Friction torques with known functions: slow sines, residuals that are correlated in time."""

import numpy as np
from scipy.signal import lfilter

from pivident.studies.friction.friction_torque import FrictionTorque

RATE = 500.0


def motion(rng, samples):
    """Position and speed of three slow sines with random phases."""
    t = np.arange(samples) / RATE
    w = 2 * np.pi * np.array([0.23, 0.41, 0.67])
    size, phase = rng.uniform(0.3, 1.0, 3), rng.uniform(0.0, 2 * np.pi, 3)
    arguments = w * t[:, None] + phase
    q = np.sin(arguments) @ size
    dq = np.cos(arguments) @ (w * size)
    ddq = -np.sin(arguments) @ (w**2 * size)
    return t, q, dq, ddq


def coloured(rng, samples, std, memory):
    """AR(1) noise with so many samples of memory."""
    a = np.exp(-1.0 / memory)
    return lfilter([std * np.sqrt(1 - a * a)], [1.0, -a], rng.standard_normal(samples))


def friction_torque(
    seed=0,
    samples=10000,
    *,
    forwards=lambda v: 3.0 + 1.2 * v,
    backwards=None,
    position=lambda q: 0.0 * q,
    load_factor=0.0,
    drift=0.0,
    std=0.3,
    memory=10.0,
    name="elbow",
):
    """A joint with chosen friction; ``drift`` is the change over the record [N m]."""
    rng = np.random.default_rng(seed)
    t, q, dq, ddq = motion(rng, samples)
    s, v = np.sign(dq), np.abs(dq)
    load = 4.0 * np.cos(q) + 0.5 * ddq
    level = np.where(s > 0, forwards(v), (backwards or forwards)(v))
    level = level + load_factor * np.abs(load) + drift * t / t[-1]
    tau = s * level + position(q) + coloured(rng, samples, std, memory)
    columns = np.column_stack([dq, s, np.ones(samples)])
    law = columns @ np.linalg.lstsq(columns, tau, rcond=None)[0]
    return FrictionTorque(
        name=name,
        torque_unit="N m",
        position_unit="rad",
        rate=RATE,
        t=t,
        q=q,
        dq=dq,
        ddq=ddq,
        load=load,
        tau=tau,
        law=law,
        record=np.zeros(samples, dtype=int),
        moving=v > 0.03,
        standstill=0.03,
        band=20.0,
        load_std=0.05,
    )
