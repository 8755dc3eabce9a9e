"""Filters of a five-bar: all of them find the same on a record with little noise."""

import numpy as np
import pytest

from pivident.dynamics.base_parameters import base_parameters
from pivident.dynamics.parameters import nominal_values
from pivident.dynamics.robot_regressor import regressor_of
from pivident.estimation.literature.filters import KalmanFilter
from pivident.estimation.literature.filters.kalman_filters import (
    CentralDifferenceKalman,
    ExtendedKalman,
    UnscentedKalman,
)
from pivident.foundation.errors import FilterDiverged, LoopNotClosed
from pivident.robot.gallery import load_robot

RATE, SAMPLES = 1000.0, 600

METHODS = (
    UnscentedKalman(),
    UnscentedKalman(square_root=True),
    CentralDifferenceKalman(),
    CentralDifferenceKalman(square_root=True),
)


@pytest.fixture(scope="module")
def scene():
    """Motion in formulas and the torques of the projected regressor in the middle of periods."""
    robot = load_robot("five_bar")
    base = base_parameters(robot)
    theta = base.values(nominal_values(robot, base.standard))
    rest = np.array(robot.constraints.posture)[list(robot.places)]
    w, phase = np.linspace(9.0, 13.0, robot.size), np.linspace(0.3, 1.1, robot.size)

    def motion(t):
        at = w * t[:, None] + phase
        return rest + 0.2 * np.sin(at), 0.2 * w * np.cos(at), -0.2 * w**2 * np.sin(at)

    t = np.arange(SAMPLES) / RATE
    tau = regressor_of(robot, base.parameters).matrix(*motion(t - 0.5 / RATE)) @ theta
    rng = np.random.default_rng(1)
    tau += 0.02 * rng.standard_normal(tau.shape)
    q, dq, _ = motion(t)
    return robot, base, theta, q + 1e-6 * rng.standard_normal(q.shape), dq, tau


def filtered(scene, method):
    robot, base, theta, q, dq, tau = scene
    spread = 0.1 * np.abs(theta) + 1e-3
    first = theta + 0.5 * spread * np.random.default_rng(2).standard_normal(theta.size)
    made = KalmanFilter(
        robot, base.parameters, first, np.diag(spread**2), rate=RATE, encoder_std=1e-6,
        torque_std=0.02, method=method,
    )  # fmt: skip
    made.start(q[0], dq[0], 1e-3)
    return first, made, made.run(q[1:], tau[1:])[0]


def test_the_extended_filter_comes_to_the_truth(scene):
    theta = scene[2]
    first, made, z = filtered(scene, ExtendedKalman())
    whole = np.linalg.inv(made.covariance)
    off = made.theta - theta
    # Σ of the squares of as many independent errors as there are parameters
    assert off @ whole @ off < 3.0 * theta.size
    assert (first - theta) @ whole @ (first - theta) > 1000.0 * theta.size
    np.testing.assert_allclose(np.mean(z**2), 1.0, atol=0.15)


@pytest.mark.parametrize("method", METHODS, ids=lambda m: f"{m.label} {m.square_root}")
def test_sigma_points_find_what_the_tangent_does(scene, method):
    _, expected, _ = filtered(scene, ExtendedKalman())
    _, found, _ = filtered(scene, method)
    std = np.sqrt(np.diag(expected.covariance))
    assert np.abs(found.theta - expected.theta).max() > 0.0
    assert (np.abs(found.theta - expected.theta) < 0.1 * std).all()
    np.testing.assert_allclose(np.sqrt(np.diag(found.covariance)), std, rtol=0.05)


def test_a_filter_says_where_loops_do_not_close(scene):
    _, _, _, q, _, tau = scene
    _, made, _ = filtered(scene, ExtendedKalman())
    with pytest.raises(LoopNotClosed, match="left"):
        made.start(np.array([np.pi, 0.0]))
    made.start(q[0], np.array([1500.0, -1500.0]), 1e-3)  # half a turn in a period, apart
    with pytest.raises(FilterDiverged, match="loops of the mechanism do not close"):
        made.run(q[1:], tau[1:])
