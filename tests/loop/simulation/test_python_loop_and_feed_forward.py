"""Laws given as Python functions, and feed-forward from nominal parameters."""

from dataclasses import replace

import numpy as np
import pytest

from pivident.dynamics.forward import make_model
from pivident.dynamics.parameters import nominal_values, standard_parameters
from pivident.foundation.errors import (
    ExperimentError,
    MassMatrixNotPositiveDefinite,
    SimulationDiverged,
)
from pivident.loop.simulation.closed_loop import LoopSignals, simulate
from pivident.loop.simulation.control_loop import computed_torque_feed_forward, gravity_feed_forward
from pivident.loop.simulation.controllers import PD, PythonController, inverse_controller
from pivident.loop.simulation.reference import point_to_point
from pivident.robot.gallery import load_robot

RATE = 2000.0
KP, KD = np.array([900.0, 300.0]), np.array([60.0, 20.0])


@pytest.fixture(scope="module")
def arm():
    robot = load_robot("planar_2r")
    standard = standard_parameters(robot)
    theta = nominal_values(robot, standard)
    postures = np.array([[0.0, 0.0], [1.0, -0.8], [-0.5, 0.6]])
    motion = point_to_point(postures, np.array([3.0, 3.0]), RATE, 2500)
    return robot, standard, theta, motion


def signals_of(motion, **changes):
    signals = LoopSignals(
        RATE, motion[0], motion[1], None, None, np.ones(2), np.full(2, np.inf),
        np.full(2, 1.0), np.full(2, 100.0),
    )  # fmt: skip
    return replace(signals, **changes)


def python_pd():
    memory = {}

    def law(k, q, q_ref, dq_ref):
        last = memory.get("q", q)
        memory["q"] = q
        return KP * (q_ref - q) + KD * (dq_ref - (q - last) * RATE)

    return PythonController(law, reset=memory.clear, linear=PD(KP, KD))


def test_a_python_law_runs_as_the_compiled_one(arm):
    robot, standard, theta, motion = arm
    model = make_model(robot, standard, theta)
    noise = 1e-4 * np.random.default_rng(1).standard_normal(motion[0].shape)
    noise[0] = 0.0  # the compiled law starts from the true position, Python's from the seen one
    signals = signals_of(motion, noise=noise, limit=np.array([60.0, 20.0]))
    compiled = simulate(model, PD(KP, KD), signals, robot.joint_names)
    law = python_pd()
    for _ in range(2):  # the second run starts afresh
        python = simulate(model, law, signals, robot.joint_names)
    for channel in ("q", "dq", "ddq", "tau", "command"):
        ours, theirs = getattr(python, channel), getattr(compiled, channel)
        assert np.abs(ours - theirs).max() < 1e-9 * max(1.0, np.abs(theirs).max()), channel


def test_a_python_law_that_pushes_the_wrong_way_is_stopped(arm):
    robot, standard, theta, motion = arm
    model = make_model(robot, standard, theta)
    law = PythonController(lambda k, q, q_ref, dq_ref: -KP * (q_ref - q))
    with pytest.raises(SimulationDiverged, match="joint"):
        simulate(model, law, signals_of(motion), robot.joint_names)


def test_a_python_law_meets_the_same_check_of_the_mass_matrix(arm):
    robot, standard, theta, motion = arm
    model = make_model(robot, standard, -theta)
    with pytest.raises(MassMatrixNotPositiveDefinite):
        simulate(model, python_pd(), signals_of(motion), robot.joint_names)


def test_the_prefilter_of_a_python_law_is_that_of_its_linear_neighbour():
    python = inverse_controller(python_pd(), RATE, 2)
    linear = inverse_controller(PD(KP, KD), RATE, 2)
    assert all(np.array_equal(a, b) for a, b in zip(python, linear, strict=True))
    with pytest.raises(ExperimentError, match="direct"):
        inverse_controller(PythonController(lambda *a: np.zeros(2)), RATE, 2)


def test_computed_torque_makes_the_robot_follow(arm):
    robot, standard, theta, motion = arm
    model = make_model(robot, standard, theta)
    forward = computed_torque_feed_forward(robot, standard, theta, *motion)
    without = simulate(model, PD(KP, KD), signals_of(motion), robot.joint_names)
    start = motion[0][0], np.zeros(2)
    held = simulate(model, PD(KP, KD), signals_of(motion, inputs=forward), robot.joint_names, start)
    error = [np.abs(run.q - motion[0]).max() for run in (without, held)]
    assert error[1] < 0.02 * error[0]


def test_gravity_feed_forward_holds_the_robot_at_rest(arm):
    robot, standard, theta, motion = arm
    still = np.tile(motion[0][1000], (400, 1))
    forward = gravity_feed_forward(robot, standard, theta, still)
    assert np.abs(forward).max() > 0.1
    # friction's offset is part of the inverse model too, so nothing is left for the law to do
    signals = signals_of((still, np.zeros_like(still)), inputs=forward)
    model = make_model(robot, standard, theta)
    run = simulate(model, PD(KP, KD), signals, robot.joint_names)
    assert np.abs(run.q - still).max() < 1e-9
