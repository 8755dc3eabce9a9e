"""The step of mechanisms with closed loops, against their forward dynamics and differences."""

from dataclasses import replace

import numpy as np
import pytest
from numba import njit

from pivident.dynamics.base_parameters import base_parameters
from pivident.dynamics.parameters import nominal_values
from pivident.dynamics.robot_regressor import regressor_of
from pivident.estimation.literature.filters.midpoint_step import (
    ACCELERATION,
    beside,
    midpoint_step,
    step_tangent,
    step_work,
)
from pivident.estimation.literature.filters.recursive import RecursiveLeastSquares
from pivident.estimation.literature.filters.robot_equations import robot_equations
from pivident.foundation.errors import LoopNotClosed
from pivident.robot import FrictionLaw, coulomb, spring, viscous
from pivident.robot.gallery import load_robot
from tests.forward_dynamics import acceleration


@njit(cache=True)
def _step(equations, work, theta, q, dq, tau, h, ahead):
    return midpoint_step(equations, work, theta, q, dq, tau, h, ahead[0], ahead[1])


@njit(cache=True)
def _tangent(equations, work, h):
    return step_tangent(equations, work, h)


@njit(cache=True)
def _beside(equations, work, theta, dq, tau, h, a):
    return beside(equations, work, theta, dq, tau, h, a)


class Mechanism:
    """A mechanism of the gallery with friction and a spring in its passive joints."""

    def __init__(self, name):
        plain = load_robot(name)
        passive = plain.passive_joints[0].name
        law = FrictionLaw((viscous(), coulomb(), spring()))
        robot = plain.with_friction({passive: law})
        worth = {f"fv[{passive}]": 0.4, f"fc[{passive}]": 0.3, f"ks[{passive}]": 2.0}
        self.robot = replace(robot, friction_nominal=robot.friction_nominal | worth)
        self.base = base_parameters(self.robot)
        self.theta = self.base.values(nominal_values(self.robot, self.base.standard))
        self.equations = robot_equations(self.robot, self.base.parameters)
        self.rest = np.array(self.robot.constraints.posture)[list(self.robot.places)]
        self.work = step_work(self.equations, self.rest)

    def step(self, theta, q, dq, tau, h):
        ahead = np.zeros((2, self.robot.size))
        assert _step(self.equations, self.work, theta, q, dq, tau, h, ahead) == -1
        return ahead.ravel()

    def state(self, seed):
        rng, n = np.random.default_rng(seed), self.robot.size
        return self.rest + rng.uniform(-0.1, 0.1, n), rng.uniform(0.5, 1.5, n), rng.normal(size=n)


NAMES = ("five_bar", "parallelogram_palletizer", "delta")


@pytest.fixture(scope="module", params=NAMES)
def mechanism(request):
    return Mechanism(request.param)


def test_the_tangent_is_that_of_the_step(mechanism):
    n, h = mechanism.robot.size, 1e-3
    q, dq, tau = mechanism.state(1)
    mechanism.step(mechanism.theta, q, dq, tau, h)
    assert _tangent(mechanism.equations, mechanism.work, h)
    solved = mechanism.work.solved
    by_q, by_dq = -solved[:, :n], -solved[:, n : 2 * n] - 0.5 * h * solved[:, :n]
    of_a = np.hstack([by_q, by_dq, -solved[:, 2 * n : -n], solved[:, -n:]])
    x = np.concatenate([q, dq, mechanism.theta, tau])
    names = [p.name for p in mechanism.base.parameters]
    assert any(name.startswith("ks[") for name in names)

    def speed(x):
        own = x[2 * n : -n].copy(), x[:n].copy(), x[n : 2 * n].copy(), x[-n:].copy()
        return mechanism.step(*own, h)[n:]

    for k in range(x.size):
        by = np.zeros(x.size)
        by[k] = 1e-4 * max(abs(x[k]), 0.1)
        # to fourth order, so that the differences are as exact as the tangent
        near = (speed(x + by) - speed(x - by)) / (2.0 * by[k])
        wide = (speed(x + 2.0 * by) - speed(x - 2.0 * by)) / (4.0 * by[k])
        slope = ((4.0 * near - wide) / 3.0 - (np.arange(n) == k - n)) / h
        largest = max(1.0, np.abs(of_a[:, k]).max())
        np.testing.assert_allclose(slope / largest, of_a[:, k] / largest, atol=1e-6)


def test_small_steps_are_the_forward_dynamics(mechanism):
    n = mechanism.robot.size
    q, dq, tau = mechanism.state(2)
    wanted = acceleration(
        mechanism.robot, mechanism.base.parameters, mechanism.theta, q[None], dq[None], tau[None]
    )[0]
    found = (mechanism.step(mechanism.theta, q, dq, tau, 1e-7)[n:] - dq) / 1e-7
    np.testing.assert_allclose(found, wanted, rtol=1e-4, atol=1e-4 * np.abs(wanted).max())


def test_other_parameters_at_the_same_motion_have_the_acceleration_of_their_own_step(mechanism):
    h, (q, dq, tau) = 1e-3, mechanism.state(3)
    rng, work, theta = np.random.default_rng(4), mechanism.work, mechanism.theta
    others = theta * (1.0 + 0.01 * rng.standard_normal(theta.size))
    mechanism.step(others, q, dq, tau, h)
    expected = work.vectors[ACCELERATION].copy()
    mechanism.step(theta, q, dq, tau, h)
    found = work.vectors[ACCELERATION].copy()
    assert np.abs(found - expected).max() > 1e-4 * np.abs(expected).max()
    assert _tangent(mechanism.equations, work, h)
    assert _beside(mechanism.equations, work, others, dq, tau, h, found)
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-9 * np.abs(expected).max())


def test_where_loops_do_not_close_the_mechanism_stays_where_it_was():
    mechanism = Mechanism("five_bar")
    n, (q, dq, tau) = mechanism.robot.size, mechanism.state(5)
    expected = mechanism.step(mechanism.theta, q, dq, tau, 1e-3)
    apart = np.array([np.pi, 0.0])  # the cranks point away from each other
    ahead = np.zeros((2, n))
    failed = _step(
        mechanism.equations, mechanism.work, mechanism.theta, apart, dq, tau, 1e-3, ahead
    )
    assert failed == n
    found = mechanism.step(mechanism.theta, q, dq, tau, 1e-3)
    np.testing.assert_allclose(found, expected, rtol=1e-12)
    with pytest.raises(LoopNotClosed):
        step_work(mechanism.equations, apart)


def test_recursions_take_the_rows_of_the_projected_regressor(mechanism):
    rng, parameters, n = np.random.default_rng(6), mechanism.base.parameters, mechanism.robot.size
    q = mechanism.rest + rng.uniform(-0.1, 0.1, (200, n))
    dq, ddq, tau = rng.normal(size=(3, 200, n))
    recursion = RecursiveLeastSquares.of_robot(mechanism.robot, parameters)
    for own in zip(q, dq, ddq, tau, strict=True):
        recursion.update_motion(*own)
    rows = regressor_of(mechanism.robot, parameters).matrix(q, dq, ddq).reshape(200 * n, -1)
    expected = np.linalg.lstsq(rows, tau.ravel(), rcond=None)[0]
    np.testing.assert_allclose(recursion.theta, expected, rtol=1e-6, atol=1e-6)
