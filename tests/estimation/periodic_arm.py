"""The planar arm of the tests on a multisine, with noise in its loop and on its torque."""

from functools import cache

import numpy as np

from pivident.data.recording.recording import Recording
from pivident.estimation.problem import Problem
from pivident.robot.gallery import load_robot
from tests.planar_arm import nominal_parameters, planar_record

RATE, LENGTH, PERIODS = 1000.0, 4000, 6


@cache
def multisine(length: int = LENGTH, seed: int = 0) -> np.ndarray:
    """One period of a reference with lines to 3 Hz, shape (length, 2) [rad]."""
    rng = np.random.default_rng(seed)
    lines = np.arange(1, 13)
    t = np.arange(length) / length
    phases = rng.uniform(0.0, 2.0 * np.pi, (2, lines.size))
    waves = np.sin(2.0 * np.pi * lines[None, :, None] * t + phases[:, :, None])
    return (0.6 * waves / np.sqrt(lines)[None, :, None]).sum(axis=1).T / 1.5


@cache
def reference(periods: int = PERIODS) -> np.ndarray:
    """The multisine over and over, shape (samples, 2) [rad]."""
    return np.tile(multisine(), (periods, 1))


def periodic_problem(
    seed: int, encoder_noise: float = 2e-5, torque_noise: float = 0.2, periods: int = PERIODS
) -> tuple[Problem, dict[str, float]]:
    """A simulated record of the arm, and its true parameters by name."""
    base, theta = nominal_parameters()
    rng = np.random.default_rng(1000 + seed)
    q_ref = reference(periods)
    q, tau = planar_record(base, theta, q_ref, RATE, rng, encoder_noise=encoder_noise)
    tau = tau + torque_noise * rng.standard_normal(tau.shape)
    names = ("shoulder", "elbow")
    record = Recording(f"multisine-{seed}", names, q, tau, RATE, q_ref=q_ref)
    truth = dict(zip((p.name for p in base.parameters), theta.tolist(), strict=True))
    return Problem(load_robot("planar_2r"), (record,)), truth
