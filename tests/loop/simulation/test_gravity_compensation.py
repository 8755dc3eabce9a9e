"""Laws that compensate gravity: their torque, the loop that they make, what they refuse."""

from dataclasses import replace

import numpy as np
import pytest

from pivident.dynamics.forward import make_model
from pivident.dynamics.parameters import nominal_values, standard_parameters
from pivident.dynamics.regressor import Regressor
from pivident.foundation.errors import ExperimentError
from pivident.loop.simulation.closed_loop import LoopSignals, simulate
from pivident.loop.simulation.controllers import PD, PythonController
from pivident.loop.simulation.gravity_compensation import GravityCompensated, GravityModel
from pivident.loop.simulation.reference import point_to_point
from pivident.robot.gallery import load_robot

RATE = 1000.0
KP, KD = np.array([900.0, 300.0]), np.array([60.0, 20.0])


def weights(robot):
    """Parameters that gravity acts on, and nominal values of them."""
    standard = standard_parameters(robot)
    theta = nominal_values(robot, standard)
    heavy = [k for k, p in enumerate(standard) if p.stem in ("mx", "my", "mz", "m")]
    return [standard[k] for k in heavy], theta[heavy]


@pytest.mark.parametrize("name", ["planar_2r", "staubli_tx40", "emps"])
def test_gravity_is_that_of_the_observation_matrix_at_rest(name):
    robot = load_robot(name)
    if name == "emps":  # an axis that lifts its carriage
        robot = robot.with_gravity(-9.81 * robot.joints[0].rotation[:, 2])
    parameters, _ = weights(robot)
    rng = np.random.default_rng(4)
    theta = rng.uniform(0.5, 2.0, len(parameters))
    q = rng.uniform(-2.0, 2.0, (50, robot.size))
    still = np.zeros_like(q)
    gain = rng.uniform(1.0, 3.0, robot.size)
    expected = Regressor.build(robot, parameters).torque(q, still, still, theta) / gain
    assert np.abs(expected).max() > 1.0
    made = GravityModel.of(robot, parameters, theta, gain).torque(q)
    np.testing.assert_allclose(made, expected, atol=1e-11 * np.abs(expected).max())


@pytest.fixture(scope="module")
def arm():
    robot = load_robot("planar_2r")
    standard = standard_parameters(robot)
    model = make_model(robot, standard, nominal_values(robot, standard))
    postures = np.array([[0.0, 0.0], [1.0, -0.8], [-0.5, 0.6]])
    q_ref, dq_ref, _ = point_to_point(postures, np.array([3.0, 3.0]), RATE, 1500)
    noise = 1e-4 * np.random.default_rng(1).standard_normal(q_ref.shape)
    noise[0] = 0.0
    signals = LoopSignals(
        RATE, q_ref, dq_ref, None, noise, np.ones(2), np.full(2, np.inf), np.full(2, 1.0),
        np.full(2, 100.0),
    )  # fmt: skip
    return robot, model, signals


def in_python(robot, scale, at_reference=False):
    """PD and gravity as a Python function, from the observation matrix."""
    parameters, theta = weights(robot)
    regressor, memory = Regressor.build(robot, parameters), {}

    def law(k, q, q_ref, dq_ref):
        last = memory.get("q", q)
        memory["q"] = q
        x = (q_ref if at_reference else q)[None].copy()
        g = regressor.torque(x, 0.0 * x, 0.0 * x, scale * theta)[0]
        return KP * (q_ref - q) + KD * (dq_ref - (q - last) * RATE) + g

    return PythonController(law, memory.clear)


@pytest.mark.parametrize("at", ["measured", "reference"])
def test_the_loop_is_that_of_the_same_law_in_python(arm, at):
    robot, model, signals = arm
    parameters, theta = weights(robot)
    law = GravityCompensated(PD(KP, KD), **{at: GravityModel.of(robot, parameters, 0.9 * theta)})
    ours = simulate(model, law, signals, robot.joint_names)
    theirs = simulate(model, in_python(robot, 0.9, at == "reference"), signals, robot.joint_names)
    for channel in ("q", "dq", "tau"):
        expected = getattr(theirs, channel)
        error = np.abs(getattr(ours, channel) - expected).max()
        assert error < 1e-9 * max(1.0, np.abs(expected).max()), channel
    without = simulate(model, PD(KP, KD), signals, robot.joint_names)
    assert np.abs(without.q - ours.q).max() > 1e-3


def test_the_law_reads_whole_counts_as_the_same_law_in_python_does(arm):
    robot, model, signals = arm
    count = np.array([2e-3, 1e-3])
    law = GravityCompensated(PD(KP, KD), GravityModel.nominal(robot))
    made = simulate(model, law, replace(signals, count=count), robot.joint_names)
    own = in_python(robot, 1.0)

    def rounded(k, q, q_ref, dq_ref):
        return own.function(k, count * np.round(q / count), q_ref, dq_ref)

    expected = simulate(model, PythonController(rounded, own.reset), signals, robot.joint_names)
    assert np.abs(made.q - expected.q).max() < 1e-9
    smooth = simulate(model, law, signals, robot.joint_names)
    assert np.abs(made.q - smooth.q).max() > 1e-5
    # the loop rounds for a law in Python, too
    asked = simulate(model, own, replace(signals, count=count), robot.joint_names)
    assert np.abs(asked.q - expected.q).max() < 1e-9


def test_what_cannot_be_compensated_is_refused(arm):
    robot, model, signals = arm
    own = GravityModel.nominal(robot)
    function = PythonController(lambda k, q, q_ref, dq_ref: np.zeros(2))
    with pytest.raises(ExperimentError, match="let the function add it"):
        simulate(model, GravityCompensated(function, own), signals, robot.joint_names)
    six = GravityModel.nominal(load_robot("staubli_tx40"))
    with pytest.raises(ExperimentError, match="6 joints, but the robot has 2"):
        GravityCompensated(PD(KP, KD), six).check(2)
