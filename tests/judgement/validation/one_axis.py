"""A simulated linear axis in a loop that repeats its motion, with known noise and model error."""

import numpy as np

from pivident.data.recording.recording import Recording
from pivident.dynamics.base_parameters import base_parameters
from pivident.dynamics.forward import make_model
from pivident.estimation.problem import Problem
from pivident.loop.simulation.closed_loop import LoopSignals, simulate
from pivident.loop.simulation.control_loop import Loop
from pivident.loop.simulation.controllers import PD
from pivident.robot.gallery import load_robot

_W = np.linspace(0.0, np.pi, 10001)

#: White torque noise of unit deviation after alignment: cos(ω/2) of the average over two periods,
#: over Numerov's (10 + 2 cos ω)/12.
ALIGNED_NOISE = float(np.sqrt(np.mean((np.cos(_W / 2) * 12 / (10 + 2 * np.cos(_W))) ** 2)))

RATE, PERIOD = 500.0, 1000
TRUTH = {"m1": 95.0, "fv1": 200.0, "fc1": 20.0, "off1": -3.0}
CONTROLLER = PD(kp=[9e5], kd=[2.4e4])


def reference(samples):
    """Position, speed and acceleration of two sines with a common period of 2 s."""
    t = np.arange(samples) / RATE
    q, dq, ddq = np.zeros((3, samples))
    for amplitude, harmonic in ((0.08, 1), (0.03, 3), (0.01, 5)):
        w = 2.0 * np.pi * harmonic * RATE / PERIOD
        q += amplitude * (1.0 - np.cos(w * t))
        dq += amplitude * w * np.sin(w * t)
        ddq += amplitude * w**2 * np.cos(w * t)
    return q[:, None], dq[:, None], ddq[:, None]


def motion(samples=4 * PERIOD, truth=None, delay=0.0):
    """The axis on its reference, simulated with the true parameters."""
    robot = load_robot("emps")
    heads = base_parameters(robot).parameters
    values = TRUTH | (truth or {})
    model = make_model(robot, heads, np.array([values[p.name] for p in heads]))
    q_ref, dq_ref, _ = reference(samples)
    signals = LoopSignals(
        RATE,
        q_ref,
        dq_ref,
        None,
        None,
        np.ones(1),
        np.full(1, np.inf),
        np.ones(1),
        np.full(1, 50.0),
        delay,
    )
    return simulate(model, CONTROLLER, signals, robot.joint_names)


def recording(made, noise=1.0, model_error=0.0, seed=0, name="axis", **changes):
    """Its record: white torque noise [N], and a force that depends on the place [N, amplitude]."""
    rng = np.random.default_rng(seed)
    cogging = model_error * np.sin(2.0 * np.pi * made.q / 0.06)
    tau = made.tau + cogging + noise * rng.standard_normal(made.tau.shape)
    q = made.q + 1e-9 * rng.standard_normal(made.q.shape)
    q_ref, dq_ref, ddq_ref = reference(len(q))
    fields = {"q_ref": q_ref, "dq_ref": dq_ref, "ddq_ref": ddq_ref} | changes
    return Recording(name, ("carriage",), q, tau, RATE, **fields)


def problem(*recordings, **changes):
    """What is given to the estimator."""
    return Problem(load_robot("emps"), recordings, Loop(CONTROLLER), **changes)
