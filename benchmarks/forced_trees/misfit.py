"""How much of a mechanism's torque a forced description cannot make, whatever its parameters."""

from __future__ import annotations

import numpy as np
from benchmarks.mujoco_mechanism import truth_of

from pivident.dynamics.base_parameters import base_parameters
from pivident.dynamics.robot_regressor import closing_states, regressor_of
from pivident.robot.description import Robot

from .models import Forced


def random_states(robot: Robot, count: int = 600, seed: int = 0, share: float = 0.35):
    rng = np.random.default_rng(seed)
    low, high = np.array([j.position_limits for j in robot.joints]).T
    middle, half = 0.5 * (low + high), share * (high - low)
    q = middle + half * rng.uniform(-1.0, 1.0, (count, robot.size))
    dq = 3.0 * half * rng.uniform(-1.0, 1.0, (count, robot.size))
    ddq = 12.0 * half * rng.uniform(-1.0, 1.0, (count, robot.size))
    return closing_states(robot, q, dq, ddq)


def misfit(machine: Robot, forced: Forced) -> np.ndarray:
    """Rms of what is left of each joint's torque over its rms, shape (joints,)."""
    base, truth = truth_of(machine)
    q, dq, ddq = random_states(machine)
    tau = regressor_of(machine, base.parameters).torque(q, dq, ddq, truth)
    ratio = np.ones(machine.size) if forced.ratio is None else np.array(forced.ratio)
    q, dq, ddq, tau = q * ratio, dq * ratio, ddq * ratio, tau / ratio
    if forced.reading is not None:
        none = np.zeros_like(q)
        at_zero = forced.reading(none, none)[0]
        dq, ddq = (forced.reading(x, none)[0] - at_zero for x in (dq, ddq))
        q, tau = forced.reading(q, tau)
    robot = forced.robot
    x = regressor_of(robot, base_parameters(robot).parameters).matrix(q, dq, ddq)
    size = np.sqrt(np.mean(tau**2, axis=0))
    rows, right = (x / size[:, None]).reshape(-1, x.shape[2]), (tau / size).ravel()
    rows = rows / np.linalg.norm(rows, axis=0)
    theta = np.linalg.lstsq(rows, right, rcond=1e-13)[0]
    left = (right - rows @ theta).reshape(tau.shape)
    return np.sqrt(np.mean(left**2, axis=0))
