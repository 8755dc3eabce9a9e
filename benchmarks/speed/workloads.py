"""What is timed: the TX40's record, simulated records of any length, robots of any size."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np

from pivident.dynamics.base_parameters import base_parameters
from pivident.dynamics.forward import Model, make_model
from pivident.dynamics.parameters import nominal_values, standard_parameters
from pivident.dynamics.regressor import Regressor
from pivident.estimation.problem import Problem
from pivident.experiment import simulated_tx40 as scenarios
from pivident.foundation.errors import PividentError
from pivident.loop.simulation.closed_loop import LoopSignals
from pivident.loop.simulation.control_loop import Loop, virtual_pd
from pivident.loop.simulation.controllers import PD
from pivident.loop.simulation.reference import point_to_point
from pivident.robot.description import Joint, Link, Robot
from pivident.robot.gallery import load_robot
from pivident.robot.transmission import Transmission

#: Samples of the simulated record.
SAMPLES = 34_500

RATE = scenarios.RATE


@cache
def whole_job() -> tuple[str, Problem]:
    """The TX40's public record where it is at hand, a simulated one otherwise."""
    try:
        from pivident.data.recording.public_records import load_staubli_tx40

        record = load_staubli_tx40()
    except (PividentError, OSError) as missing:
        print(f"(TX40 record not at hand: {missing})")
        problem, _ = scenarios.tx40_fine()
        return "simulated TX40 record, 34,500 x 6, 28 parameters", problem
    robot = load_robot("staubli_tx40")
    names = (*scenarios.TX40_ESSENTIAL, *(f"off{j}" for j in range(1, 7)))
    loop = Loop(virtual_pd(robot, record.q.mean(axis=0)), reference="smoothed")
    return "TX40 record, 45,000 x 6, 34 parameters", Problem(robot, (record,), loop, names)


@cache
def simulated_record(samples: int, parameters: int = 28) -> Problem:
    """A record of the scenario *fine*, of any length.

    Args:
        samples: length at 5 kHz.
        parameters: how many are estimated: the 28 essential ones, then the six offsets, then other
            base parameters.
    """
    problem, _ = scenarios.tx40_fine(samples=samples)
    first = (*scenarios.TX40_ESSENTIAL, *(f"off{j}" for j in range(1, 7)))
    others = [p.name for p in base_parameters(problem.robot).parameters]
    names = [*first, *(n for n in others if n not in first)]
    return replace(problem, parameters=tuple(names[:parameters]))


def arm(joints: int, branches: int = 1, seed: int = 7) -> Robot:
    """A robot of revolute joints with random frames and slender links.

    Args:
        joints: how many.
        branches: chains that hang on the first link; 1 makes a serial arm.
        seed: of the frames.
    """
    rng = np.random.default_rng(seed)
    made, links = [], []
    last = [0] * branches
    for i in range(joints):
        branch = (i - 1) % branches
        parent = -1 if i == 0 else last[branch]
        if i > 0:
            last[branch] = i
        turn, _ = np.linalg.qr(rng.standard_normal((3, 3)))
        turn *= np.sign(np.linalg.det(turn))
        place = np.zeros(3) if i == 0 else rng.uniform(-0.2, 0.2, 3)
        made.append(Joint(f"j{i + 1}", "revolute", parent, turn, place, rated_speed=3.0))
        links.append(Link(f"l{i + 1}", slender(rng.uniform(0.5, 3.0), rng.uniform(-0.1, 0.1, 3))))
    return Robot(
        name=f"arm of {joints}",
        joints=tuple(j.with_friction(j.friction) for j in made),
        links=tuple(links),
        gravity=np.array([0.0, 0.0, -9.81]),
        rotor_inertia=np.full(joints, 0.1),
        transmission=Transmission(np.eye(joints), np.ones(joints), np.zeros(joints)),
        friction_nominal={
            f"{s}{i + 1}": v for i in range(joints) for s, v in (("fv", 1.0), ("fc", 1.0))
        },
    )


def slender(mass: float, centre: np.ndarray) -> np.ndarray:
    """Ten inertial parameters of a body of some extent around its centre of mass."""
    own = np.diag([0.004, 0.005, 0.006]) * mass
    whole = own + mass * (centre @ centre * np.eye(3) - np.outer(centre, centre))
    first = mass * centre
    upper = [whole[0, 0], whole[0, 1], whole[0, 2], whole[1, 1], whole[1, 2], whole[2, 2]]
    return np.array([*upper, *first, mass])


def motion_of(robot: Robot, samples: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Moves between random postures: q, dq, ddq, each (samples, joints)."""
    rng = np.random.default_rng(3)
    postures = rng.uniform(-1.5, 1.5, (12 + samples // 3000, robot.size))
    return point_to_point(postures, 0.6 * robot.rated_speeds, RATE, samples)


def values_of(robot: Robot) -> Model:
    """The robot with its nominal parameters."""
    standard = standard_parameters(robot)
    return make_model(robot, standard, nominal_values(robot, standard))


def base_regressor(robot: Robot) -> Regressor:
    """Observation matrix of the base parameters."""
    return Regressor.build(robot, base_parameters(robot).parameters)


def loop_of(robot: Robot, samples: int) -> tuple[PD, LoopSignals]:
    """A proportional-derivative law of 10 Hz on the robot's own motion."""
    q, dq, _ = motion_of(robot, samples)
    n = robot.size
    inertia = robot.rotor_inertia + 1.0
    bandwidth = 2.0 * np.pi * 10.0
    law = PD(inertia * bandwidth**2, inertia * 2.0 * bandwidth)
    endless = np.full(n, np.inf)
    return law, LoopSignals(
        RATE, q, dq, None, None, np.ones(n), endless, np.full(n, 5.0), np.full(n, 500.0)
    )
