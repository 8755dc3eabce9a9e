"""The record: what MuJoCo makes of the arm, and what encoders and drives log of it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .arm import DEFAULT_TIME, STEP, Bodies, mjcf

#: Standard deviations of white noise: of encoders [rad], speeds [rad/s], torques [N m].
ENCODER, SPEED = 1e-4, 2e-3
TORQUE = np.array([0.2, 0.25, 0.1])


@dataclass(frozen=True, eq=False)
class Record:
    """One run, every signal of shape (samples, joints).

    ``mean_torque`` is what a drive logs that holds its torque over the period which begins at the
    sample, ``torque`` what MuJoCo's sensor shows at the sample: each program gets its own kind.
    """

    start: np.ndarray  # positions before the first sample, at rest and known [rad], (joints,)
    u: np.ndarray  # reference of the position actuators [rad]
    q: np.ndarray  # [rad]
    dq: np.ndarray  # [rad/s]
    torque: np.ndarray  # [N m]
    mean_torque: np.ndarray  # [N m]


def simulated(bodies: Bodies, u: np.ndarray, friction_time: float = DEFAULT_TIME) -> Record:
    """The run without noise; the actuators carry the arm at rest at first."""
    import mujoco
    from mujoco import rollout

    model = mujoco.MjModel.from_xml_string(mjcf(bodies, friction_time))
    data = mujoco.MjData(model)
    data.qpos[:] = u[0]
    for _ in range(20):  # kp (u - q) = g(q)
        mujoco.mj_forward(model, data)
        data.qpos[:] = u[0] - data.qfrc_bias / bodies.chain.kp
    at_rest = data.qpos.copy()
    full = mujoco.mjtState.mjSTATE_FULLPHYSICS
    start = np.empty(mujoco.mj_stateSize(model, full))
    mujoco.mj_getState(model, data, start, full)
    # sensors show the state at the beginning of each step
    _, sensors = rollout.rollout(model, data, start, u)
    q, dq, torque = np.split(np.asarray(sensors)[0], 3, axis=1)
    # over a period u is held and q is not: τ̄ = kp (u - q̄) - kv Δq/h, trapezoid with end slopes
    after = np.vstack([q[1:], q[-1] + STEP * dq[-1]])
    speeds = np.diff(np.vstack([dq, dq[-1]]), axis=0)
    mean = 0.5 * (q + after) - STEP / 12.0 * speeds
    mean_torque = bodies.chain.kp * (u - mean) - bodies.chain.kv * (after - q) / STEP
    return Record(at_rest, u, q, dq, torque, mean_torque)


def measured(true: Record, seed: int) -> Record:
    """The same run behind noisy sensors."""
    rng = np.random.default_rng(seed)
    noise = rng.normal(size=(3, *true.q.shape))
    return Record(
        true.start,
        true.u,
        true.q + ENCODER * noise[0],
        true.dq + SPEED * noise[1],
        true.torque + TORQUE * noise[2],
        true.mean_torque + TORQUE * noise[2],
    )
