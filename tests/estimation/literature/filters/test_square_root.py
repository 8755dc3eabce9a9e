"""Filters that carry factors of the covariance are the plain ones."""

from dataclasses import replace

import numpy as np
import pytest

from pivident.estimation.literature.filters import KalmanFilter
from pivident.estimation.literature.filters.kalman_filters import (
    CentralDifferenceKalman,
    UnscentedKalman,
)
from pivident.estimation.literature.filters.triangular import cholesky, lower_factor, update_factor
from tests.estimation.literature.filters.scenes import RATE, planar_problem


@pytest.mark.parametrize("method", [UnscentedKalman(), CentralDifferenceKalman()], ids=repr)
def test_square_roots_are_the_plain_filter(method):
    problem, theta = planar_problem(samples=800)
    recording = problem.recordings[0]
    spread = 0.02 * np.abs(theta) + 1e-3
    found = []
    for square_root in (False, True):
        kalman = KalmanFilter(
            problem.robot,
            problem.regressor.parameters,
            theta + spread,
            np.diag(spread**2),
            rate=RATE,
            encoder_std=2e-6,
            torque_std=0.05,
            standstill=0.03,
            still_std=2.0,
            method=replace(method, square_root=square_root),
        )
        kalman.start(recording.q[0])
        z, s = kalman.run(recording.q[1:], recording.tau[:-1])
        found.append((kalman.theta / spread, kalman.covariance / np.outer(spread, spread), z, s))
    # each point's step is solved to 1e-10 of its acceleration, and where it stops is rounding's
    # choice: that is 1e-8 of an innovation at times
    for plain, rooted in zip(*found, strict=True):
        np.testing.assert_allclose(rooted, plain, rtol=1e-6, atol=1e-6)


def test_factors_multiply_to_what_they_are_of():
    rng = np.random.default_rng(0)
    wide = rng.standard_normal((5, 12))
    product = wide @ wide.T
    factor = np.zeros((5, 5))
    assert cholesky(product, factor) == -1
    np.testing.assert_allclose(factor, np.linalg.cholesky(product), rtol=1e-12)
    lower_factor(wide, 12)
    np.testing.assert_allclose(wide[:, :5], factor, atol=1e-12)
    v = rng.standard_normal(5)
    assert update_factor(factor, v.copy(), 1.0) == -1
    np.testing.assert_allclose(factor @ factor.T, product + np.outer(v, v), rtol=1e-12)
    assert update_factor(factor, v.copy(), -1.0) == -1
    np.testing.assert_allclose(factor @ factor.T, product, rtol=1e-9)
    assert update_factor(factor, 100.0 * v, -1.0) >= 0
    assert cholesky(-product, factor) == 0
