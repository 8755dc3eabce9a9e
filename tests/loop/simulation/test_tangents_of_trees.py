"""Tangents of simulated trees of links, drawn at random, against central differences.

Friction is smooth enough for the simulation to take the same kind of step at every sample.
"""

import pytest
from hypothesis import given, settings, strategies as st

from pivident.dynamics.parameters import nominal_values, standard_parameters
from pivident.loop.simulation.control_loop import virtual_pd
from pivident.loop.simulation.direction import Direction, ParametrisedLoop
from pivident.robot.friction import FrictionLaw, coulomb, lugre, offset, ripple, spring, viscous
from tests.loop.simulation.loops import reversals, signals_of
from tests.loop.simulation.test_tangents import assert_tangents

pytest.importorskip("pinocchio")
from tests.dynamics.trees import RandomTree

RATE = 2000.0


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_directions_of_any_tree(seed):
    tree = RandomTree(seed, largest=6)
    rng = tree.rng
    robot = tree.robot.with_friction(FrictionLaw((viscous(), coulomb(gamma=5.0), offset())))
    n = robot.size
    parameters = standard_parameters(robot)
    theta = nominal_values(robot, parameters)
    for k, p in enumerate(parameters):
        if not p.is_inertial:
            theta[k] = rng.uniform(0.1, 0.5)
    q_ref, dq_ref = reversals(60, RATE, rng.uniform(0.2, 0.5, n), rng.uniform(1.0, 2.0, n))
    posture = rng.uniform(-1.0, 1.0, n)
    q_ref = q_ref + posture
    signals = signals_of(RATE, q_ref, dq_ref, drive_delay=0.3 / RATE)
    start = posture + 0.01, rng.uniform(0.5, 1.0, n)
    loop = ParametrisedLoop(
        robot, parameters, theta, virtual_pd(robot, posture, 15.0), signals, start
    )
    chosen = rng.choice(len(parameters), 6, replace=False)
    directions = [Direction("parameter", parameters[k].name) for k in chosen]
    joint = int(rng.integers(n))
    kinds = ("initial_position", "initial_speed", "torque_offset", "encoder_offset", "drive_gain")
    directions += [Direction(kind, joint=joint) for kind in kinds]
    assert_tangents(loop, [*directions, Direction("law", "kp", joint), Direction("delay")])


@settings(max_examples=10, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_presliding_in_any_tree(seed):
    tree = RandomTree(seed, largest=5)
    rng = tree.rng
    terms = (viscous(), *lugre(5e-2, 0.3, 0.5), *ripple(3.0), spring())
    robot = tree.robot.with_friction(FrictionLaw(terms))
    n, rate = robot.size, 2000.0
    parameters = standard_parameters(robot)
    theta = nominal_values(robot, parameters)
    for k, p in enumerate(parameters):
        if not p.is_inertial:
            theta[k] = rng.uniform(0.1, 0.5)
    q_ref, dq_ref = reversals(60, rate, rng.uniform(0.2, 0.5, n), rng.uniform(1.0, 2.0, n))
    posture = rng.uniform(-1.0, 1.0, n)
    signals = signals_of(rate, q_ref + posture, dq_ref, drive_delay=0.3 / rate)
    start = posture + 0.01, rng.uniform(0.5, 1.0, n)
    law = virtual_pd(robot, posture, 15.0)
    loop = ParametrisedLoop(robot, parameters, theta, law, signals, start)
    chosen = rng.choice(len(parameters), 6, replace=False)
    directions = [Direction("parameter", parameters[k].name) for k in chosen]
    joint = int(rng.integers(n))
    directions += [Direction("shape", "presliding_distance", joint), Direction("delay")]
    assert_tangents(loop, [*directions, Direction("initial_speed", joint=joint)], 1e-5)
