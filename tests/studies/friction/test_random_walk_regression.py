"""The smoother with a regressor against statsmodels, a smoothing spline and closed forms."""

import numpy as np
import pytest
from scipy.interpolate import make_smoothing_spline
from statsmodels.tsa.statespace.mlemodel import MLEModel
from statsmodels.tsa.statespace.structural import UnobservedComponents

from pivident.studies.friction.random_walk_regression import (
    START,
    nvr_by_likelihood,
    smooth_parameter,
)


@pytest.fixture
def sorted_data():
    rng = np.random.default_rng(3)
    u = np.sort(rng.uniform(0, 1, 150))
    u[0], u[-1], u[40:43] = 0.0, 1.0, u[40]  # ties
    z = rng.uniform(-2, 2, u.size)
    z[70:75] = 0.0  # nothing is seen here
    y = np.sin(6 * u) * z + 0.2 * rng.standard_normal(u.size)
    return u, z, y


def statsmodels_smoother(u, z, y, nvr, order):
    """The same state space model, noise variance one, in statsmodels."""
    model = MLEModel(np.where(z == 0.0, np.nan, y), k_states=2, k_posdef=2)
    d = np.append(np.diff(u), 0.0)
    transition, noise = np.zeros((2, 2, u.size)), np.zeros((2, 2, u.size))
    transition[0, 0] = transition[1, 1] = 1.0
    if order == 2:
        transition[0, 1] = d
        noise[0, 0], noise[0, 1], noise[1, 0], noise[1, 1] = d**3 / 3, d**2 / 2, d**2 / 2, d
    else:
        noise[0, 0] = d
    model["transition"], model["state_cov"] = transition, nvr * noise
    model["selection"], model["obs_cov"] = np.eye(2), np.eye(1)
    model["design"] = np.stack([z, 0 * z])[None]
    model.ssm.initialize_known(np.zeros(2), np.diag([START, START if order == 2 else 0.0]))
    model.ssm.loglikelihood_burn = 0
    return model.ssm.smooth()


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("nvr", [1e-2, 30.0, 1e4])
def test_smoother_is_that_of_statsmodels(sorted_data, order, nvr):
    u, z, y = sorted_data
    own = smooth_parameter(u, z, y, nvr, order)
    other = statsmodels_smoother(u, z, y, nvr, order)
    np.testing.assert_allclose(own.value, other.smoothed_state[0], atol=1e-5)
    np.testing.assert_allclose(own.variance, other.smoothed_state_cov[0, 0], rtol=1e-4, atol=1e-7)
    seen = z != 0
    squares = other.forecasts_error[0, seen] ** 2 / other.forecasts_error_cov[0, 0, seen]
    assert own.noise_variance == pytest.approx(squares.sum() / (seen.sum() - order), rel=1e-5)


def test_likelihood_is_that_of_a_local_level():
    rng = np.random.default_rng(0)
    n = 300
    y = np.cumsum(0.3 * rng.standard_normal(n)) + rng.standard_normal(n)
    fitted = UnobservedComponents(y, "llevel").fit(disp=False)
    noise, level = fitted.params
    u = np.linspace(0, 1, n)
    nvr, on_bound = nvr_by_likelihood([(u, np.ones(n), y)], 1)
    assert not on_bound
    assert nvr / (n - 1) == pytest.approx(level / noise, rel=0.1)
    assert smooth_parameter(u, np.ones(n), y, nvr, 1).noise_variance == pytest.approx(
        noise, rel=0.05
    )


@pytest.mark.parametrize("nvr", [10.0, 1e4])
def test_second_order_is_the_cubic_smoothing_spline(nvr):
    rng = np.random.default_rng(1)
    u = np.linspace(0, 1, 120) ** 1.5
    y = np.exp(2 * u) + 0.3 * rng.standard_normal(u.size)
    spline = make_smoothing_spline(u, y, lam=1.0 / nvr)
    own = smooth_parameter(u, np.ones(u.size), y, nvr, 2)
    np.testing.assert_allclose(own.value, spline(u), atol=1e-5)


def test_a_line_asks_for_the_lower_bound():
    rng = np.random.default_rng(2)
    u = np.sort(rng.uniform(0, 1, 500))
    y = 2 + 3 * u + 0.1 * rng.standard_normal(500)
    nvr, on_bound = nvr_by_likelihood([(u, np.ones(500), y)], 2)
    line = np.polyval(np.polyfit(u, y, 1), u)
    assert nvr < 1.0
    assert on_bound or nvr < 0.1
    np.testing.assert_allclose(smooth_parameter(u, np.ones(500), y, nvr, 2).value, line, atol=0.01)


def test_several_sets_agree_with_one():
    rng = np.random.default_rng(4)
    u = np.sort(rng.uniform(0, 1, 4000))
    y = np.sin(8 * u) + 0.3 * rng.standard_normal(4000)
    one = np.ones(4000)
    whole, _ = nvr_by_likelihood([(u, one, y)])
    parts, _ = nvr_by_likelihood([(u[k::4], one[k::4], y[k::4]) for k in range(4)])
    assert abs(np.log10(whole / parts)) < 0.5
