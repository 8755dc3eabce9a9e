"""Derivatives of the inverse dynamics against complex steps and the regressor's own."""

import numpy as np
import pytest

from pivident.dynamics.inverse_derivatives import inverse_dynamics_derivatives
from pivident.dynamics.parameters import nominal_values, standard_parameters
from pivident.dynamics.regressor import Regressor
from pivident.dynamics.regressor_derivatives import RegressorDerivatives
from pivident.robot.gallery import load_robot
from tests.dynamics.newton_euler import torques

STEP = 1e-30


def states(robot, samples, seed=0):
    return np.random.default_rng(seed).uniform(-2.0, 2.0, (3, samples, robot.size))


def agree(ours, theirs, tolerance):
    for mine, other in zip(ours, theirs, strict=True):
        np.testing.assert_allclose(mine, other, rtol=0, atol=tolerance * np.abs(other).max())


@pytest.mark.parametrize("name", ["staubli_tx40", "planar_2r"])
def test_serial_arms_by_complex_steps(name):
    """The inertial part against complex steps through Newton–Euler in another form."""
    robot = load_robot(name)
    parameters = tuple(p for p in standard_parameters(robot) if p.is_inertial)
    theta = nominal_values(robot, parameters)
    weights = np.tile(theta, (robot.size, 1))
    motion = states(robot, 2)
    ours = inverse_dynamics_derivatives(robot, parameters, theta, *motion)
    expected = np.zeros((3, 2, robot.size, robot.size))
    for quantity in range(3):
        for s in range(2):
            for k in range(robot.size):
                state = [x[s].astype(complex) for x in motion]
                state[quantity][k] += 1j * STEP
                torque = torques(robot, parameters, *state, weights)
                expected[quantity, s, :, k] = torque.imag / STEP
    agree(ours, expected, 1e-12)


@pytest.mark.parametrize("name", ["staubli_tx40", "planar_2r", "mitsubishi_rv2sq"])
def test_all_parameters_agree_with_the_regressors_derivatives(name):
    """Rotors, friction and couplings: Φ's own derivatives, weighted by the parameters."""
    robot = load_robot(name)
    parameters = standard_parameters(robot)
    theta = np.random.default_rng(3).uniform(0.5, 2.0, len(parameters))
    motion = states(robot, 4)
    ours = inverse_dynamics_derivatives(robot, parameters, theta, *motion)
    regressor = Regressor.build(robot, parameters)
    weights = np.broadcast_to(theta, (4, robot.size, theta.size))
    theirs = RegressorDerivatives.of(regressor).weighted(*motion, weights)
    agree(ours, np.moveaxis(theirs, -1, 0), 1e-12)


def test_shapes_that_do_not_fit_are_refused():
    robot = load_robot("planar_2r")
    parameters = standard_parameters(robot)
    theta = nominal_values(robot, parameters)
    q = np.zeros((3, 2))
    with pytest.raises(ValueError, match=r"\(samples, joints\) = \(3, 2\) is needed"):
        inverse_dynamics_derivatives(robot, parameters, theta, q, q, q[:2])
    with pytest.raises(ValueError, match="theta has shape"):
        inverse_dynamics_derivatives(robot, parameters, theta[1:], q, q, q)
