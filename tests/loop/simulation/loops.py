"""Loops to simulate, and the control laws written a second time for the tests."""

import numpy as np

from pivident.dynamics.forward import make_model
from pivident.dynamics.parameters import nominal_values, standard_parameters
from pivident.loop.simulation.closed_loop import LoopSignals, simulate
from pivident.robot.gallery import load_robot

CHANNELS = ("q", "dq", "ddq", "tau", "command")

#: Gains of the TX40's position loop in joint torque (Leboutet et al., 2021).
TX40_KP = np.array([341.86905, 375.0, 190.343925, 150.16365, 183.24195, 358.858725]) * np.array(
    [35.24, 32.04, 23.94, 9.05, 15.5, 6.56]
)
TX40_KD = np.array([2.5361, 4.1174, 1.1793, 0.5462, 0.5714, 0.1954]) * np.array(
    [35.24, 32.04, 23.94, 9.05, 15.5, 6.56]
)


def nominal_model(name):
    """A robot of the gallery and its model with nominal parameters."""
    robot = load_robot(name)
    parameters = standard_parameters(robot)
    return robot, make_model(robot, parameters, nominal_values(robot, parameters))


def reversals(samples, rate, amplitude, frequency):
    """Sines that fade in: all joints pass through standstill, each at times of its own."""
    t = np.arange(samples)[:, None] / rate
    fade = np.sin(0.5 * np.pi * np.minimum(t / 0.1, 1.0)) ** 2
    q = np.asarray(amplitude) * fade * np.sin(2.0 * np.pi * np.asarray(frequency) * t)
    return q, np.gradient(q, 1.0 / rate, axis=0)


def signals_of(rate, q_ref, dq_ref=None, **changes):
    """Loop signals without noise, inputs or limits unless they are given."""
    n = q_ref.shape[1]
    fields = {
        "inputs": None,
        "noise": None,
        "drive_gain": np.ones(n),
        "limit": np.full(n, np.inf),
        "bound": np.full(n, 10.0),
        "speed_bound": np.full(n, 1e4),
    }
    return LoopSignals(rate, q_ref, dq_ref, **(fields | changes))


def run(robot, model, controller, signals, **options):
    """Simulate a robot of the gallery."""
    return simulate(model, controller, signals, robot.joint_names, **options)


def relative_rms(ours, theirs):
    """Root of the mean square difference over that of ``theirs``, joint by joint."""
    return np.sqrt(((ours - theirs) ** 2).mean(axis=0) / (theirs**2).mean(axis=0))


def command_of(controller, rate, q, q_ref, dq_ref=None, limit=np.inf):
    """Commands of a law for one joint on a given motion, sample by sample, in plain Python.

    Args:
        controller: a PID or Cascade of one joint.
        rate: control rate [Hz].
        q: positions that the law reads, list.
        q_ref: reference positions, list.
        dq_ref: reference speeds, list or None.
        limit: largest command.
    """
    step = PIDSteps if hasattr(controller, "derivative_time") else CascadeSteps
    law = step(controller, 1.0 / rate, q[0], q_ref[0])
    speeds = [None] * len(q) if dq_ref is None else dq_ref
    return np.array([law(*sample, limit) for sample in zip(q, q_ref, speeds, strict=True)])


class PIDSteps:
    """PID with a filtered derivative and an integrator that rests in the limit."""

    def __init__(self, law, h, q, q_ref):
        self.kp, self.kd = float(law.kp[0]), float(law.kd[0])
        self.ki = 0.0 if law.ki is None else float(law.ki[0])
        self.h, self.lag = h, law.derivative_time
        self.share = law.speed_feed_forward
        self.last_q, self.last_ref = q, q_ref
        self.speed = self.wanted = self.integral = 0.0

    def __call__(self, q, q_ref, dq_ref, limit):
        # T dv/dt + v = dq/dt by backward Euler
        self.speed = (self.lag * self.speed + q - self.last_q) / (self.lag + self.h)
        self.wanted = (self.lag * self.wanted + q_ref - self.last_ref) / (self.lag + self.h)
        self.last_q, self.last_ref = q, q_ref
        error = q_ref - q
        wanted = self.wanted if dq_ref is None else dq_ref
        grown = self.integral + self.ki * self.h * error
        u = self.kp * error + self.kd * (self.share * wanted - self.speed) + grown
        held = max(-limit, min(limit, u))
        if (u - held) * error <= 0.0:
            self.integral = grown
        return held


class CascadeSteps:
    """Position loop around a speed loop with an integrator."""

    def __init__(self, law, h, q, q_ref):
        self.kp, self.kv = float(law.kp[0]), float(law.kv[0])
        self.ki = 0.0 if law.ki is None else float(law.ki[0])
        self.h, self.averaged, self.share = h, law.averaged, law.speed_feed_forward
        self.before, self.last_q, self.last_ref = q, q, q_ref
        self.integral = 0.0

    def __call__(self, q, q_ref, dq_ref, limit):
        if self.averaged:
            speed = (0.5 * (q + self.last_q) - 0.5 * (self.last_q + self.before)) / self.h
        else:
            speed = (q - self.last_q) / self.h
        wanted = (q_ref - self.last_ref) / self.h if dq_ref is None else dq_ref
        self.before, self.last_q, self.last_ref = self.last_q, q, q_ref
        error = self.kp * (q_ref - q) + self.share * wanted - speed
        grown = self.integral + self.kv * self.ki * self.h * error
        u = self.kv * error + grown
        held = max(-limit, min(limit, u))
        if (u - held) * error <= 0.0:
            self.integral = grown
        return held
