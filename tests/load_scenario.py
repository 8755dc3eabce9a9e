"""Simulated records of an arm without and with a load that nobody knows, torques in N m.

Motion, loop and encoder noise are those of `tests.payload_scenario`; the log holds
joint torques with sensor noise, and the load is what is sought.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pivident.data.recording.recording import Recording
from pivident.estimation.drives.drive_equations import motor_coupling
from pivident.estimation.drives.known_payload import Payload
from pivident.estimation.problem import Problem
from pivident.experiment.simulated_tx40 import _KD, _KP
from pivident.loop.simulation.control_loop import Loop
from pivident.loop.simulation.controllers import PD
from pivident.loop.simulation.simulated_record import stream
from pivident.robot.gallery import load_robot
from tests.payload_scenario import tx40_in_amperes

#: One kilogram on the flange, beside its axis, with an inertia that is not aligned with it.
LOAD = Payload(
    mass=1.0,
    center_of_mass=(0.03, -0.02, 0.10),
    inertia=(0.0012, 0.0001, -0.0002, 0.0015, 0.0001, 0.0009),
)

#: Stream of random numbers of the torque sensors.
SENSOR = 8


@dataclass(frozen=True, eq=False)
class LoadedArm:
    """One run of the scenario.

    Attributes:
        problem: robot, the record without load, the loop.
        loaded: the record with the load.
        load: the truth.
    """

    problem: Problem
    loaded: Recording
    load: Payload


def tx40_with_load(
    seed: int = 0,
    samples: int = 14000,
    torque_noise: float = 0.05,
    load: Payload = LOAD,
    friction_factor: float = 1.0,
    reach_of_wrist: float = 1.0,
) -> LoadedArm:
    """Records in N m, without and with a load on the flange of a TX40.

    Args:
        seed: of the noise; the motion is always the same.
        samples: length of each record at 2 kHz; 14,000 are 7 s.
        torque_noise: standard deviation of the torque sensors [N m].
        load: what the flange carries.
        friction_factor: friction with the load over that without.
        reach_of_wrist: how far the wrist moves, relative to the usual motion.
    """
    arm = tx40_in_amperes(
        seed,
        samples,
        current_noise=0.0,
        payload=load,
        friction_factor=friction_factor,
        reach_of_wrist=reach_of_wrist,
    )
    robot = load_robot("staubli_tx40")
    loop = Loop(PD(_KP, _KD), drive_gain=arm.gains)
    empty, loaded = (
        _in_newton_metres(recording, arm.gains, torque_noise, (seed, 1 + carried))
        for carried, recording in enumerate((arm.problem.recordings[0], arm.loaded))
    )
    return LoadedArm(Problem(robot, (empty,), loop), loaded, load)


def _in_newton_metres(
    recording: Recording, gains: np.ndarray, noise: float, seed: tuple[int, int]
) -> Recording:
    """A record in amperes with the torque that its currents make, seen by noisy sensors."""
    coupling = motor_coupling(load_robot("staubli_tx40").transmission)
    currents = np.linalg.solve(coupling, recording.tau.T)
    torque = (coupling @ (gains[:, None] * currents)).T
    return replace(
        recording,
        tau=torque + noise * stream(seed, SENSOR).standard_normal(torque.shape),
    )
