"""Exciting motions: inside their limits, at rest at the start, well conditioned."""

import json

import numpy as np
import pytest

from pivident.dynamics.base_parameters import base_parameters
from pivident.dynamics.regressor import Regressor
from pivident.foundation.codec import decode
from pivident.foundation.text.plain_values import plain
from pivident.loop.simulation.excitation import (
    FourierSeries,
    motion_limits,
    optimised_series,
    random_series,
)
from pivident.robot.gallery import load_robot

ROBOT = load_robot("planar_2r")
LIMITS = motion_limits(ROBOT, 0.8, 30.0)


@pytest.fixture(scope="module")
def series():
    return optimised_series(ROBOT, base_parameters(ROBOT).parameters, LIMITS, 5, 0.2, 3, 400)


@pytest.mark.parametrize("seed", range(4))
def test_a_motion_stays_inside_its_limits(seed):
    q, dq, ddq = random_series(LIMITS, 6, 0.2, seed).sampled(1000.0, 5000)
    assert (q > LIMITS.low).all() and (q < LIMITS.high).all()
    assert (np.abs(dq) < LIMITS.speed).all()
    assert (np.abs(ddq) < LIMITS.acceleration).all()
    used = [np.abs(dq).max(0) / LIMITS.speed, np.abs(ddq).max(0) / LIMITS.acceleration]
    used.append(np.ptp(q, axis=0) / (LIMITS.high - LIMITS.low))
    assert np.max(used, axis=0).min() > 0.9  # … and makes use of one of them


def test_a_motion_starts_at_rest_and_repeats_itself(series):
    q, dq, ddq = series.sampled(1000.0, 5001)
    assert np.abs(dq[0]).max() < 1e-12 and np.abs(ddq[0]).max() < 1e-11
    assert np.allclose(q[0], q[-1], atol=1e-12)


def test_speeds_and_accelerations_are_derivatives(series):
    q, dq, ddq = series.sampled(2000.0, 4000)
    assert np.allclose(np.gradient(q, 5e-4, axis=0)[1:-1], dq[1:-1], atol=1e-4)
    assert np.allclose(np.gradient(dq, 5e-4, axis=0)[1:-1], ddq[1:-1], atol=1e-3)


def test_the_criterion_is_that_of_the_observation_matrix(series):
    parameters = base_parameters(ROBOT).parameters
    w = Regressor.build(ROBOT, parameters).matrix(*series.sampled(0.2 * 50, 50))
    singular = np.linalg.svd(w.reshape(-1, len(parameters)), compute_uv=False)
    cost = (singular[0] / singular[-1]) ** 2 + 100 / singular[-1]
    assert series.cost == pytest.approx(cost, rel=1e-6)


def test_the_search_finds_better_motions_than_chance(series):
    parameters = base_parameters(ROBOT).parameters
    chance = optimised_series(ROBOT, parameters, LIMITS, 5, 0.2, 3, 100)
    assert series.cost < 0.8 * chance.cost


def test_a_seed_is_a_motion(series):
    again = optimised_series(ROBOT, base_parameters(ROBOT).parameters, LIMITS, 5, 0.2, 3, 400)
    assert np.array_equal(series.a, again.a)
    assert not np.array_equal(
        random_series(LIMITS, 5, 0.2, 1).a, random_series(LIMITS, 5, 0.2, 2).a
    )


def test_a_motion_is_read_back_bit_for_bit(series):
    back = decode(FourierSeries, json.loads(json.dumps(plain(series))))
    for name in ("offset", "a", "b"):
        assert np.array_equal(getattr(back, name), getattr(series, name))
    assert back.cost == series.cost
