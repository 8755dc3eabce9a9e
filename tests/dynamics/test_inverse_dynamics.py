"""Torques of one state and of many: against the observation matrix, Pinocchio, and each other."""

import pickle
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from pivident.dynamics.base_parameters import base_parameters
from pivident.dynamics.inverse_dynamics import InverseDynamics
from pivident.dynamics.parameters import standard_parameters
from pivident.dynamics.robot_regressor import regressor_of
from pivident.models import runnable_model
from pivident.models.consistency.consistent_model import make_consistent
from pivident.robot.description import INERTIAL
from pivident.robot.friction import (
    FrictionLaw,
    asymmetric_coulomb,
    coulomb,
    load_dependent,
    lugre,
    offset,
    power_viscous,
    ripple,
    spring,
    stribeck,
    viscous,
)
from pivident.robot.gallery import load_robot
from tests.synthetic_identification import synthetic_identification

LAWS = {
    "as described": None,
    "smooth": FrictionLaw(
        (
            viscous(),
            coulomb("tanh"),
            offset(),
            stribeck(0.2),
            load_dependent(),
            *ripple(3),
            spring(),
        )
    ),
    "hard": FrictionLaw((power_viscous(0.7), *asymmetric_coulomb("sign"), load_dependent("sign"))),
}


def model(robot, columns=standard_parameters, seed=0):
    """A model with values at random, and its motion."""
    rng = np.random.default_rng(seed)
    parameters = tuple(columns(robot))
    motion = rng.normal(size=(3, 40, robot.size))
    return InverseDynamics(robot, parameters, rng.normal(size=len(parameters))), motion


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("name", ["staubli_tx40", "emps", "mitsubishi_rv2sq", "quadruped"])
def test_one_state_and_many_are_the_observation_matrix_times_the_parameters(name, law):
    robot = load_robot(name)
    robot = robot if LAWS[law] is None else robot.with_friction(LAWS[law])
    for columns in (standard_parameters, lambda robot: base_parameters(robot).parameters):
        torque, motion = model(robot, columns)
        inner = torque._regressor.inner(*(x.T for x in motion), theta=torque.theta)
        expected = regressor_of(robot, torque.parameters).matrix(*motion, inner=inner)
        expected = expected @ torque.theta
        closeness = {"rtol": 0.0, "atol": 1e-13 * np.abs(expected).max()}
        np.testing.assert_allclose(torque(*motion), expected, **closeness)
        single = [torque(*state) for state in zip(*motion, strict=True)]
        np.testing.assert_allclose(single, expected, **closeness)
        np.testing.assert_allclose(torque(*(list(x[0]) for x in motion)), single[0], **closeness)


@pytest.mark.parametrize("seed", range(30))
def test_one_state_is_rnea_of_pinocchio(seed):
    pytest.importorskip("pinocchio")
    from tests.dynamics.trees import RandomTree

    tree = RandomTree(seed)
    tree.draw_inertias()
    parameters = [p for p in standard_parameters(tree.robot) if p.is_inertial]
    values = [tree.inertia[p.joint, INERTIAL.index(p.stem)] for p in parameters]
    torque = InverseDynamics(tree.robot, tuple(parameters), np.array(values))
    q, dq, ddq = tree.states(3)
    expected = tree.rnea(q, dq, ddq)
    found = [torque(*state) for state in zip(q, dq, ddq, strict=True)]
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-11 * np.abs(expected).max())


def test_one_state_of_a_closed_mechanism_is_that_of_the_samples():
    torque, motion = model(load_robot("five_bar"))
    q, dq, ddq = 0.1 * motion
    single = [torque(*state) for state in zip(q, dq, ddq, strict=True)]
    np.testing.assert_allclose(single, torque(q, dq, ddq), rtol=1e-9, atol=1e-9)


def test_an_estimate_its_models_and_their_copies_have_the_torques_of_predict():
    found = synthetic_identification()
    q, dq, ddq = np.random.default_rng(3).normal(size=(3, 30, 2))
    expected = found.predict(q, dq, ddq)
    assert found.torque is found.torque  # prepared once
    free = runnable_model(found)
    for torque in (found.torque, pickle.loads(pickle.dumps(found)).torque, free.torque):
        np.testing.assert_allclose(torque(q, dq, ddq), expected, rtol=0, atol=1e-9)
        np.testing.assert_allclose(torque(q[4], dq[4], ddq[4]), expected[4], rtol=0, atol=1e-9)
    consistent = make_consistent(found)
    by_values = runnable_model(consistent).torque(q, dq, ddq)
    np.testing.assert_array_equal(consistent.torque(q, dq, ddq), by_values)


def test_threads_share_one_model():
    torque, motion = model(load_robot("staubli_tx40"))
    states = list(zip(*motion, strict=True)) * 25
    with ThreadPoolExecutor(4) as pool:
        found = list(pool.map(lambda state: torque(*state), states))
    expected = [torque(*state) for state in states]
    np.testing.assert_array_equal(found, expected)


def test_wrong_shapes_and_one_state_of_a_memory_are_refused():
    torque, (q, dq, ddq) = model(load_robot("planar_2r"))
    with pytest.raises(ValueError, match=r"shapes \(2,\), \(2,\), \(1,\)"):
        torque(q[0], dq[0], ddq[0, :1])
    with pytest.raises(ValueError, match="shapes"):
        torque(q, dq[:3], ddq)
    with pytest.raises(ValueError, match="shapes"):
        torque(q[0, 0], dq[0, 0], ddq[0, 0])
    robot = load_robot("planar_2r").with_friction(FrictionLaw(lugre(0.01, 0.5, 0.1)))
    remembering, _ = model(robot)
    assert remembering(q, dq, ddq).shape == q.shape
    with pytest.raises(ValueError, match="since standstill"):
        remembering(q[0], dq[0], ddq[0])
