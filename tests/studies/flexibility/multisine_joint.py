"""One flexible joint on a multisine that repeats, at several postures, and what it records."""

from dataclasses import replace
from functools import cache

import numpy as np

from pivident.data.recording.recording import Recording
from pivident.studies.flexibility.simulated_joint import simulate_joint
from tests.studies.flexibility.flexible_joint import COARSE, JOINT, LOOP, RATE

PERIOD, PERIODS = 5.0, 5

#: Inertias of the load at three postures [kg m²].
LOADS = (60.0, 90.0, 140.0)


@cache  # read only
def periodic_reference(top: float = 30.0, seed: int = 0, periods: int = PERIODS) -> np.ndarray:
    """A slow sine and lines from 1 Hz to ``top`` [Hz], over and over, shape (samples,) [rad]."""
    t = np.arange(round(PERIOD * RATE)) / RATE
    rng = np.random.default_rng(seed)
    lines = np.arange(1.0, top, 1.0 / PERIOD)
    phases = rng.uniform(0.0, 2.0 * np.pi, lines.size)
    sines = 2e-3 / (1.0 + lines / 3.0) * np.sin(2.0 * np.pi * np.outer(t, lines) + phases)
    return np.tile(0.4 * np.sin(2.0 * np.pi * t / PERIOD) + sines.sum(axis=1), periods)


def posture(load: float, seed: int, sensors=COARSE, **options) -> Recording:
    """A run with an inertia of the load; the motor's encoder alone."""
    joint = replace(JOINT, load_inertia=load)
    q_ref = periodic_reference(**options)
    name = f"load-{load:g}-{seed}"
    made = simulate_joint(joint, LOOP, q_ref, RATE, sensors=sensors, seed=seed, name=name)
    return replace(made, q_link=None)
