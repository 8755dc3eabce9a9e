"""Tangents of simulated mechanisms with closed loops, against central differences.

Friction is smooth enough for the simulation to take the same kind of step at every sample.
"""

import numpy as np
import pytest

from pivident.dynamics.base_parameters import base_parameters
from pivident.dynamics.parameters import nominal_values
from pivident.loop.simulation.control_loop import virtual_pd
from pivident.loop.simulation.direction import Direction, ParametrisedLoop
from pivident.robot.friction import (
    FrictionLaw,
    coulomb,
    counterbalance,
    offset,
    ripple,
    spring,
    viscous,
)
from tests.dynamics.closed.mechanisms import MECHANISMS, delta, five_bar, parallelogram, start
from tests.loop.simulation.loops import reversals, signals_of
from tests.loop.simulation.test_tangents import assert_tangents

RATE = 2000.0

SMOOTH = FrictionLaw((viscous(), coulomb(gamma=5.0), offset()))

OF_POSITION = FrictionLaw((viscous(), spring(), *counterbalance(0.6, 0.3), *ripple(3.0)))

ROBOTS = {
    "five bar": lambda: five_bar(law=SMOOTH),
    "five bar with a hinge": lambda: five_bar(kind="axis", law=SMOOTH),
    "parallelogram": lambda: parallelogram(law=SMOOTH),
    "delta": lambda: delta(law=SMOOTH, passive=SMOOTH),
    "springs": lambda: delta(law=OF_POSITION, passive=OF_POSITION),
    "geared": MECHANISMS["geared"],
}


def loop_of(robot, delay=0.3):
    rng = np.random.default_rng(4)
    n = robot.size
    base = base_parameters(robot)
    theta = base.values(nominal_values(robot, base.standard))
    for k, p in enumerate(base.parameters):
        if p.friction is not None:
            theta[k] = rng.uniform(0.1, 0.5)
    q_ref, dq_ref = reversals(60, RATE, rng.uniform(0.1, 0.2, n), rng.uniform(0.5, 1.0, n))
    posture = start(robot)
    signals = signals_of(RATE, q_ref + posture, dq_ref, drive_delay=delay / RATE)
    begin = posture + 0.01, rng.uniform(0.5, 1.0, n)
    law = virtual_pd(robot, posture, 15.0)
    return ParametrisedLoop(robot, base.parameters, theta, law, signals, begin)


@pytest.mark.parametrize("name", ROBOTS)
def test_all_parameters_and_kinds(name):
    loop = loop_of(ROBOTS[name]())
    last = loop.robot.size - 1
    directions = [Direction("parameter", p.name) for p in loop.parameters]
    kinds = ("initial_position", "initial_speed", "torque_offset", "encoder_offset", "drive_gain")
    directions += [Direction(kind, joint=last) for kind in kinds]
    assert_tangents(loop, [*directions, Direction("law", "kp", last), Direction("delay")])


def test_constants_of_friction_belong_to_independent_joints():
    loop = loop_of(ROBOTS["five bar"]())
    assert loop.robot.places == (0, 2)
    assert_tangents(loop, [Direction("shape", "gamma", j) for j in (0, 1)], 1e-5)
