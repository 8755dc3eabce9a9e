"""Simulated records with known truth: the TX40 as demo and tests identify it.

Truth are the 28 essential parameters of Brunot et al. (2018, Table 1) at the robot's nominal
values and no others, or all base parameters. The second is a machine that can exist; the first is
none, for no bodies have the other parameters all zero. The motion is drawn once, the noise anew for
each seed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cache

import numpy as np

from pivident.data.recording.recording import Recording
from pivident.dynamics.base_parameters import base_parameters
from pivident.dynamics.forward import make_model
from pivident.dynamics.parameters import nominal_values
from pivident.estimation.problem import Problem
from pivident.loop.simulation.closed_loop import LoopSignals, Trajectory, simulate
from pivident.loop.simulation.control_loop import Loop
from pivident.loop.simulation.controllers import PD
from pivident.loop.simulation.reference import point_to_point
from pivident.loop.simulation.simulated_record import Noise
from pivident.robot.description import Robot
from pivident.robot.gallery import load_robot

#: The 28 essential parameters of Table 1.
TX40_ESSENTIAL = (
    "zz1 fv1 fc1 xx2 xz2 zz2 mx2 fv2 fc2 xx3 zz3 my3 ia3 fv3 fc3 mx4 ia4 fv4 fc4 my5 ia5 fv5 fc5 "
    "ia6 fv6 fc6 fvm6 fcm6"
).split()

RATE = 5000.0

#: Inertias that a description gives, over the true ones.
OFF = 1.1

#: Gains of the TX40's position loop, joint torque per rad and rad/s: BIRDy's Kp and Kd times Kτ.
_KP = np.array([341.86905, 375.0, 190.343925, 150.16365, 183.24195, 358.858725])
_KD = np.array([2.5361, 4.1174, 1.1793, 0.5462, 0.5714, 0.1954])
_KTAU = np.array([35.24, 32.04, 23.94, 9.05, 15.5, 6.56])


#: Named noises: ``fine`` has a torque sensor, in ``loop`` the logged torque is the applied one,
#: ``coloured`` has encoder noise at 600 Hz besides, ``coarse`` is *fine* on a coarse encoder.
NOISES = {
    "fine": Noise(),
    "loop": Noise(torque=0.0),
    "coloured": Noise(torque=0.0, coloured=3e-6),
    "coarse": Noise(count=2.0 * np.pi / 3600.0),
}


def tx40_fine(seed: int = 0, samples: int = 34500) -> tuple[Problem, dict[str, float]]:
    """The scenario *fine*: white encoder noise in the loop, torque sensor noise on the record."""
    return tx40_scenario("fine", seed, samples)


def tx40_machine(seed: int = 0, samples: int = 34500) -> tuple[Problem, dict[str, float]]:
    """The scenario *fine* of a robot with all of its base parameters, all of them to estimate.

    Its description is that of a drawing: all links are a tenth too heavy.
    """
    robot = load_robot("staubli_tx40")
    problem, truth = tx40_scenario("fine", seed, samples, base_parameters(robot).names)
    links = tuple(replace(link, inertia=OFF * link.inertia) for link in robot.links)
    drawn = replace(robot, links=links, rotor_inertia=OFF * robot.rotor_inertia)
    return replace(problem, robot=drawn), truth


def tx40_scenario(
    name: str, seed: int = 0, samples: int = 34500, names: Sequence[str] = TX40_ESSENTIAL
) -> tuple[Problem, dict[str, float]]:
    """A simulated TX40 record of one of the scenarios in ``NOISES``; see :func:`tx40_fine`.

    Args:
        name: of the scenario.
        seed: of the noise.
        samples: of the record.
        names: of the base parameters that the robot has; all others are zero and known to be.
    """
    robot = load_robot("staubli_tx40")
    controller = PD(_KP * _KTAU, _KD * _KTAU)
    q_ref, dq_ref, ddq_ref = tx40_reference(samples)
    heads, truth = tx40_truth(robot, names)
    noise = NOISES[name]
    made = simulate_tx40(noise, seed, samples, names)
    recording = Recording(
        f"{name}-{seed}",
        robot.joint_names,
        noise.quantised(made.q + noise.in_loop(seed, made.q.shape)),
        made.tau + noise.of_torque(seed, made.tau.shape),
        RATE,
        q_ref=q_ref,
        dq_ref=dq_ref,
        ddq_ref=ddq_ref,
    )
    start = {p.name: 0.0 if p.friction or p.coupling else OFF * truth[p.name] for p in heads}
    return Problem(robot, (recording,), Loop(controller), tuple(names), initial=start), truth


def simulate_tx40(
    noise: Noise, seed: int, samples: int, names: Sequence[str] = TX40_ESSENTIAL
) -> Trajectory:
    """The true motion of the robot, with encoder noise in its loop."""
    robot = load_robot("staubli_tx40")
    q_ref, dq_ref, _ = tx40_reference(samples)
    heads, truth = tx40_truth(robot, names)
    model = make_model(robot, heads, np.array([truth[p.name] for p in heads]))
    n = robot.size
    signals = LoopSignals(
        RATE,
        q_ref,
        dq_ref,
        None,
        noise.in_loop(seed, q_ref.shape),
        np.ones(n),
        np.full(n, np.inf),
        np.full(n, 0.5),
        np.full(n, 50.0),
    )
    return simulate(model, PD(_KP * _KTAU, _KD * _KTAU), signals, robot.joint_names)


def tx40_truth(
    robot: Robot, names: Sequence[str] = TX40_ESSENTIAL
) -> tuple[tuple, dict[str, float]]:
    """Heads of groups of base parameters, the essential ones, and their true values by name."""
    base = base_parameters(robot)
    values = base.values(nominal_values(robot, base.standard))
    chosen = sorted(base.index(name) for name in names)
    heads = tuple(base.parameters[k] for k in chosen)
    return heads, {base.parameters[k].name: float(values[k]) for k in chosen}


@cache
def tx40_reference(samples: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Point-to-point motion through random postures at 80 % of the rated speeds."""
    robot = load_robot("staubli_tx40")
    rng = np.random.default_rng(40)
    reach = np.array([2.0, 1.2, 1.2, 2.4, 1.2, 2.4])
    postures = rng.uniform(-reach, reach, (12 + samples // 3000, robot.size))
    return point_to_point(postures, 0.8 * robot.rated_speeds, RATE, samples)
