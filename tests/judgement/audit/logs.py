"""Clean logs from the simulator, and the faults that are planted in them."""

from dataclasses import replace
from functools import cache

import numpy as np
from scipy.interpolate import CubicSpline

from pivident.data.logs.log import Log
from pivident.dynamics.base_parameters import base_parameters
from pivident.dynamics.forward import make_model
from pivident.dynamics.parameters import nominal_values
from pivident.loop.simulation.closed_loop import LoopSignals, simulate
from pivident.loop.simulation.controllers import PD
from pivident.loop.simulation.reference import point_to_point
from pivident.robot.gallery import load_robot

#: Robot, rate [Hz], gains, reach of the postures [rad], torque noise [N m].
MACHINES = {
    "planar_2r": (1000.0, [6000.0, 2500.0], [180.0, 60.0], [1.5, 1.5], 0.02),
    "staubli_tx40": (
        5000.0,
        [12047.0, 12015.0, 4557.0, 1359.0, 2840.0, 2354.0],
        [89.4, 131.9, 28.2, 4.94, 8.86, 1.28],
        [2.0, 1.2, 1.2, 2.4, 1.2, 2.4],
        0.05,
    ),
}


@cache
def clean_log(robot_name: str, seed: int, seconds: float) -> Log:
    """A record of a robot whose description is the truth, with noise on all channels."""
    rate, kp, kd, reach, torque_noise = MACHINES[robot_name]
    robot = load_robot(robot_name)
    base = base_parameters(robot)
    theta = base.values(nominal_values(robot, base.standard))
    rng = np.random.default_rng(seed)
    samples, n = round(seconds * rate), robot.size
    postures = rng.uniform(-np.array(reach), reach, (20 + round(3 * seconds), n))
    q_ref, dq_ref, _ = point_to_point(postures, 0.8 * robot.rated_speeds, rate, samples)
    noise = 2e-6 * rng.standard_normal(q_ref.shape)
    signals = LoopSignals(
        rate, q_ref, dq_ref, None, noise, np.ones(n), np.full(n, np.inf), np.full(n, 0.5),
        np.full(n, 50.0),
    )  # fmt: skip
    controller = PD(np.array(kp), np.array(kd))
    made = simulate(
        make_model(robot, base.parameters, theta), controller, signals, robot.joint_names
    )
    tau = made.tau + torque_noise * rng.standard_normal(made.tau.shape)
    t = np.arange(samples) / rate * (1 + 2e-5 * rng.standard_normal())
    channels = {"q": made.q + noise, "tau": tau, "q_ref": q_ref}
    stamps = t + 1e-6 * rng.standard_normal(samples)
    return Log(
        "clean",
        robot.joint_names,
        {},
        {"t": stamps},
        logged=channels,
        channels=channels,
        robot=robot,
    )


def planar(seed: int = 5) -> Log:
    return clean_log("planar_2r", seed, 5.0)


def tx40(seed: int = 5, seconds: float = 2.0) -> Log:
    return clean_log("staubli_tx40", seed, seconds)


def with_channels(log: Log, **channels: np.ndarray) -> Log:
    """The log with other channels, in SI as in the file."""
    new = {**log.channels, **channels}
    return replace(log, channels=new, logged=dict(new))


def with_torque(log: Log, joint: int, change) -> Log:
    """The log with the torque of one joint changed."""
    tau = log.channels["tau"].copy()
    tau[:, joint] = change(tau[:, joint])
    return with_channels(log, tau=tau)


def delayed(x: np.ndarray, samples: float) -> np.ndarray:
    """A signal that comes so many samples later, fractions included."""
    k = np.arange(len(x))
    return CubicSpline(k, x)(np.clip(k - samples, 0, len(x) - 1))


def only_rows(log: Log, rows: np.ndarray, rate: float | None = None) -> Log:
    """Some rows of the log; with a rate they lose their time stamps."""
    channels = {kind: values[rows] for kind, values in log.channels.items()}
    clocks = {} if rate else {name: t[rows] for name, t in log.clocks.items()}
    return replace(log, channels=channels, logged=dict(channels), clocks=clocks, rate=rate)


def serious(audit) -> set[tuple[str, str, str]]:
    """Everything that is not fine: severity, kind and place."""
    return {(f.severity, f.kind, f.subject) for f in audit.findings if f.severity != "ok"}
