"""Records that filters are tested on: the planar arm in its loop, and a slide that is linear."""

import numpy as np

from pivident.data.recording.recording import Recording
from pivident.estimation.problem import Problem
from pivident.loop.simulation.control_loop import Loop
from tests.planar_arm import LAW, nominal_parameters, planar_motion, planar_record

RATE = 1000.0


def planar_problem(seed=0, samples=6000, encoder=2e-6, torque=0.05, limits="auto"):
    """The planar arm with white noise of encoders and torques, and its true parameters."""
    base, theta = nominal_parameters()
    rng = np.random.default_rng(seed)
    q_ref = planar_motion(rng, RATE, samples)
    q, tau = planar_record(base, theta, q_ref, RATE, rng, encoder_noise=encoder)
    tau = tau + torque * rng.standard_normal(tau.shape)
    recording = Recording(f"planar {seed}", base.robot.joint_names, q, tau, RATE, q_ref=q_ref)
    return Problem(base.robot, (recording,), Loop(LAW), mask=limits), theta


def slide(samples=300, seed=0):
    """A mass m with viscous friction and an offset: q, tau, m, fv, off; the slide of EMPS."""
    rng = np.random.default_rng(seed)
    m, fv, off, h = 95.0, 200.0, -3.0, 1.0 / RATE
    tau = 20.0 * np.sin(np.arange(samples) * 0.02) + rng.standard_normal(samples)
    q, dq = np.zeros(samples), 0.0
    for k in range(1, samples):
        a = (tau[k] + 0.5 * rng.standard_normal() - off - fv * dq) / (m + 0.5 * h * fv)
        q[k], dq = q[k - 1] + h * (dq + 0.5 * h * a), dq + h * a
    return q[:, None] + 1e-5 * rng.standard_normal((samples, 1)), tau[:, None], (m, fv, off)
