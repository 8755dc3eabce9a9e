"""The step of the filters: its order, and its tangent against central differences."""

import numpy as np
from numba import njit

from pivident.dynamics.base_parameters import base_parameters
from pivident.dynamics.parameters import nominal_values
from pivident.estimation.literature.filters.midpoint_step import (
    ACCELERATION,
    beside,
    midpoint_step,
    step_tangent,
    step_work,
)
from pivident.estimation.literature.filters.robot_equations import robot_equations
from pivident.robot.gallery import load_robot
from tests.forward_dynamics import acceleration


@njit
def _step(equations, work, theta, q, dq, tau, h, q_next, dq_next):
    return midpoint_step(equations, work, theta, q, dq, tau, h, q_next, dq_next)


@njit
def _tangent(equations, work, h):
    return step_tangent(equations, work, h)


@njit
def _beside(equations, work, theta, dq, tau, h, a):
    return beside(equations, work, theta, dq, tau, h, a)


class Arm:
    """The TX40 with all its base parameters, couplings and friction."""

    def __init__(self, name="staubli_tx40"):
        self.base = base_parameters(load_robot(name))
        self.theta = self.base.values(nominal_values(self.base.robot, self.base.standard))
        self.equations = robot_equations(self.base.robot, self.base.parameters)
        self.work = step_work(self.equations)

    def step(self, theta, q, dq, tau, h):
        n = self.base.robot.size
        ahead = np.zeros((2, n))
        assert _step(self.equations, self.work, theta, q, dq, tau, h, ahead[0], ahead[1]) == -1
        return ahead.ravel()


def state(rng, n=6):
    return rng.uniform(-1, 1, n), rng.uniform(0.5, 1.5, n), rng.uniform(-20, 20, n)


def test_the_tangent_is_that_of_the_step():
    arm, rng = Arm(), np.random.default_rng(1)
    n, h = 6, 1e-3
    q, dq, tau = state(rng)
    arm.step(arm.theta, q, dq, tau, h)
    assert _tangent(arm.equations, arm.work, h)
    solved = arm.work.solved
    of_a = np.hstack([-solved[:, :n], -solved[:, n : 2 * n] - 0.5 * h * solved[:, :n]])
    of_a = np.hstack([of_a, -solved[:, 2 * n : -n], solved[:, -n:]])
    x = np.concatenate([q, dq, arm.theta, tau])

    def ahead(x):
        return arm.step(x[2 * n : -n].copy(), x[:n].copy(), x[n : 2 * n].copy(), x[-n:].copy(), h)

    for k in range(x.size):
        by = np.zeros(x.size)
        by[k] = 1e-5 * max(abs(x[k]), 0.1)
        slope = (ahead(x + by) - ahead(x - by))[n:] / (2.0 * by[k])
        slope = (slope - (np.arange(n) == k - n)) / h
        np.testing.assert_allclose(slope, of_a[:, k], atol=2e-6 * max(1.0, abs(of_a).max()))


def test_small_steps_are_the_forward_dynamics():
    arm, rng = Arm(), np.random.default_rng(2)
    q, dq, tau = state(rng)
    wanted = acceleration(
        arm.base.robot, arm.base.parameters, arm.theta, q[None], dq[None], tau[None]
    )[0]
    found = (arm.step(arm.theta, q, dq, tau, 1e-7)[6:] - dq) / 1e-7
    np.testing.assert_allclose(found, wanted, rtol=1e-4, atol=1e-4)


def test_errors_fall_with_the_square_of_the_step():
    arm, rng = Arm("planar_2r"), np.random.default_rng(3)
    q, dq, tau = state(rng, 2)

    def after(count, time=0.02):
        x = np.concatenate([q, dq])
        for _ in range(count):
            x = arm.step(arm.theta, x[:2].copy(), x[2:].copy(), tau, time / count)
        return x

    exact = after(1280)
    errors = [np.abs(after(count) - exact).max() for count in (10, 20, 40)]
    assert 3.5 < errors[0] / errors[1] < 4.5 and 3.5 < errors[1] / errors[2] < 4.6


def test_other_parameters_at_the_same_motion_have_the_acceleration_of_their_own_step():
    arm, rng = Arm(), np.random.default_rng(5)
    h, (q, dq, tau) = 1e-3, state(rng)
    others = arm.theta * (1.0 + 0.01 * rng.standard_normal(arm.theta.size))
    arm.step(others, q, dq, tau, h)
    expected = arm.work.vectors[ACCELERATION].copy()
    arm.step(arm.theta, q, dq, tau, h)
    found = arm.work.vectors[ACCELERATION].copy()
    assert np.abs(found - expected).max() > 1e-3 * np.abs(expected).max()
    assert _tangent(arm.equations, arm.work, h)
    assert _beside(arm.equations, arm.work, others, dq, tau, h, found)
    np.testing.assert_allclose(found, expected, rtol=1e-10, atol=1e-10 * np.abs(expected).max())
    # with a third of the inertia the steps overshoot more and more
    assert not _beside(arm.equations, arm.work, 0.3 * arm.theta, dq, tau, h, found)
