"""Simulated records in amperes with known gains: an arm without and with a payload.

The TX40 with its CAD inertias and nominal friction, all base parameters unknown to the estimator,
a position loop that commands currents, and encoder noise inside it. The log holds measured
currents.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pivident.data.recording.recording import Recording
from pivident.dynamics.base_parameters import base_parameters
from pivident.dynamics.forward import make_model
from pivident.dynamics.parameters import nominal_values
from pivident.estimation.drives.drive_equations import motor_coupling
from pivident.estimation.drives.known_payload import Payload
from pivident.estimation.problem import Problem
from pivident.experiment.simulated_tx40 import _KD, _KP, _KTAU
from pivident.loop.simulation.closed_loop import LoopSignals, simulate
from pivident.loop.simulation.control_loop import Loop
from pivident.loop.simulation.controllers import PD
from pivident.loop.simulation.reference import point_to_point
from pivident.loop.simulation.simulated_record import Noise, stream
from pivident.robot.description import Robot
from pivident.robot.gallery import load_robot

#: Two kilograms beside the axis of the flange: a cylinder of 8 cm diameter and 5 cm height.
PAYLOAD = Payload(
    mass=2.0,
    center_of_mass=(0.05, 0.0, 0.11),
    inertia=(0.0012, 0.0, 0.0, 0.0012, 0.0, 0.0016),
)

#: Sampling rate of the records and of the control law [Hz].
RATE = 2000.0

#: Stream of random numbers of the current sensors, beside those of
#: `pivident.loop.simulation.simulated_record`.
CURRENT = 7


@dataclass(frozen=True, eq=False)
class AmpereRecords:
    """One run of the scenario.

    Attributes:
        problem: robot with gain 1, the record without payload, the loop in amperes.
        loaded: the record with the payload.
        payload: the payload.
        gains: true gains on the joint side [N m/A], shape (joints,).
    """

    problem: Problem
    loaded: Recording
    payload: Payload
    gains: np.ndarray


def tx40_in_amperes(
    seed: int = 0,
    samples: int = 14000,
    current_noise: float = 0.01,
    correlation: float = 0.0,
    payload: Payload = PAYLOAD,
    friction_factor: float = 1.0,
    reach_of_wrist: float = 1.0,
) -> AmpereRecords:
    """Records in amperes, without and with a payload.

    Args:
        seed: of the noise; the motion is always the same.
        samples: length of each record at 2 kHz; 14,000 are 7 s.
        current_noise: standard deviation of the current sensors [A].
        correlation: pole of the noise's AR(1) model at 2 kHz; 0: white.
        payload: what the flange carries.
        friction_factor: friction with the payload over that without.
        reach_of_wrist: how far the wrist moves, relative to the usual motion.
    """
    robot = load_robot("staubli_tx40")
    base = base_parameters(robot)
    nominal = nominal_values(robot, base.standard)
    loaded = nominal.copy()
    for k, p in enumerate(base.standard):
        if p.friction is not None or p.coupling is not None:
            loaded[k] *= friction_factor
    truth = [base.values(nominal), base.values(loaded)]
    truth[1] = truth[1] + payload.base_columns(base) @ payload.known()
    made = [
        _record(robot, base, theta, seed, load, samples, current_noise, correlation, reach_of_wrist)
        for load, theta in enumerate(truth)
    ]
    loop = Loop(PD(_KP, _KD))
    transmission = replace(robot.transmission, drive_gain=np.ones(robot.size))
    problem = Problem(replace(robot, transmission=transmission), (made[0],), loop)
    return AmpereRecords(problem, made[1], payload, _KTAU.copy())


def _record(
    robot: Robot,
    base,
    theta: np.ndarray,
    seed: int,
    load: int,
    samples: int,
    current_noise: float,
    correlation: float,
    reach_of_wrist: float,
) -> Recording:
    """One simulated record in amperes."""
    n, noise = robot.size, Noise(rate=RATE)
    rng = np.random.default_rng(40 + load)
    reach = np.array([2.0, 1.2, 1.2, 2.4, 1.2, 2.4])
    reach[3:] *= reach_of_wrist
    postures = rng.uniform(-reach, reach, (12 + samples // 3000, n))
    q_ref, dq_ref, ddq_ref = point_to_point(postures, 0.8 * robot.rated_speeds, RATE, samples)
    encoders = noise.in_loop((seed, 1 + load), q_ref.shape)
    signals = LoopSignals(
        RATE, q_ref, dq_ref, None, encoders, _KTAU, np.full(n, np.inf), np.full(n, 0.5),
        np.full(n, 50.0),
    )  # fmt: skip
    model = make_model(robot, base.parameters, theta)
    made = simulate(model, PD(_KP, _KD), signals, robot.joint_names)
    white = stream((seed, 1 + load), CURRENT).standard_normal(made.tau.shape)
    # motor 6 drives joint 5 too: currents belong to motors, and are logged as a joint-side torque
    coupling = motor_coupling(robot.transmission)
    currents = np.linalg.solve(coupling, made.tau.T).T / _KTAU
    currents += current_noise * _coloured(white, correlation)
    return Recording(
        f"{'payload' if load else 'empty'}-{seed}",
        robot.joint_names,
        made.q + encoders,
        currents @ coupling.T,
        RATE,
        q_ref=q_ref,
        dq_ref=dq_ref,
        ddq_ref=ddq_ref,
    )


def _coloured(white: np.ndarray, correlation: float) -> np.ndarray:
    """AR(1) noise of unit variance."""
    from scipy.signal import lfilter

    if correlation == 0.0:
        return white
    return np.sqrt(1.0 - correlation**2) * lfilter([1.0], [1.0, -correlation], white, axis=0)
