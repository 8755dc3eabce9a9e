"""Drift of integrated speeds: a broken line."""

import numpy as np
import pytest
from scipy.interpolate import make_lsq_spline

from pivident.loop.instruments.second_sensor import LAGS, _broken_line, explained_noise


@pytest.mark.parametrize("pieces", [1, 2, 7])
def test_the_broken_line_is_the_nearest_one(pieces):
    x = np.random.default_rng(2).standard_normal((3, 900)).cumsum(axis=1)
    t = np.linspace(0.0, 1.0, 900)
    knots = np.linspace(0.0, 1.0, pieces + 1)
    wanted = make_lsq_spline(t, x.T, np.r_[0.0, knots, 1.0], k=1)(t).T
    np.testing.assert_allclose(_broken_line(x, pieces), wanted, atol=1e-9)


@pytest.mark.parametrize("samples", [20, 2 * LAGS + 5, 4 * LAGS + 2])
def test_fewer_samples_than_coefficients_explain_nothing(samples):
    x = np.random.default_rng(0).standard_normal((samples, 2))
    np.testing.assert_array_equal(explained_noise(x, x, 500.0), np.zeros(2))
