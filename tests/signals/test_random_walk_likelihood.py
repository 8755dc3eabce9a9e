import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from scipy.stats import multivariate_normal

from pivident.signals.random_walk_likelihood import (
    MAX_NVR,
    MIN_NVR,
    diffuse_fit,
    estimate_nvr,
)
from tests.signals.motions import (
    RATE,
    difference_matrix,
    level_by_cholesky,
    level_by_penalty,
    level_in_extended_precision,
    omega,
    point_to_point,
)


def noisy(samples, std, seed=0):
    q, _ = point_to_point(max(samples, 5000))
    return q[:samples] + std * np.random.default_rng(seed).standard_normal(samples)


@pytest.mark.parametrize("order", [1, 2, 3, 4])
def test_three_smoothers_agree(order):
    y = noisy(1500, 1e-3)
    level = diffuse_fit(y, 1e-5, order).level
    np.testing.assert_allclose(level, level_by_cholesky(y, order, 1e-5), atol=1e-12)
    np.testing.assert_allclose(level, level_by_penalty(y, order, 1e-5), atol=1e-9)


@settings(max_examples=40, deadline=None)
@given(st.integers(1, 4), st.floats(-4, 4), st.integers(20, 120))
def test_likelihood_is_that_of_the_differenced_record(order, exponent, samples):
    y, nvr = noisy(samples, 1e-2), 10**exponent
    fit = diffuse_fit(y, nvr, order)
    w = np.diff(y, order)
    covariance = omega(samples, order, nvr)
    variance = w @ np.linalg.solve(covariance, w) / w.size
    assert fit.noise_variance == pytest.approx(variance, rel=1e-6)
    exact = multivariate_normal(cov=variance * covariance).logpdf(w)
    assert fit.log_likelihood == pytest.approx(exact, rel=1e-7, abs=1e-5)


@pytest.mark.parametrize(("order", "nvr"), [(2, 1e-9), (3, 1e-7), (3, 1e-11), (4, 1e-9)])
def test_behind_the_head_nothing_of_the_likelihood_is_lost(order, nvr):
    """The recursive filter takes over long before the end of 8000 samples."""
    y = noisy(8000, 1e-3)
    d = np.diff(np.eye(order + 1), order, axis=0)[0]
    bands = np.tile(np.correlate(d, d, "full")[order:][:, None], y.size - order)
    bands[0] += nvr
    from scipy.linalg import cho_solve_banded, cholesky_banded

    factor = cholesky_banded(bands, lower=True)
    w = np.diff(y, order)
    variance = w @ cho_solve_banded((factor, True), w) / w.size
    log_det = 2 * np.log(factor[0]).sum()
    exact = -0.5 * (w.size * (np.log(2 * np.pi * variance) + 1) + log_det)
    assert diffuse_fit(y, nvr, order).log_likelihood == pytest.approx(exact, abs=2e-2)


def test_statsmodels_agrees_on_level_and_likelihood():
    from statsmodels.tsa.statespace.structural import UnobservedComponents

    y, nvr = noisy(1000, 1e-3), 1e-5
    fit = diffuse_fit(y, nvr, 2)
    model = UnobservedComponents(y, "smooth trend", use_exact_diffuse=True)
    model.ssm.tolerance = 0.0
    parameters = [fit.noise_variance, nvr * fit.noise_variance]
    state = model.smooth(parameters).smoothed_state
    np.testing.assert_allclose(fit.level, state[0], atol=1e-12)
    difference = model.loglike(parameters) - fit.log_likelihood
    assert difference == pytest.approx(-np.log(2 * np.pi), abs=1e-7)


def test_a_kalman_smoother_with_a_vague_start_agrees():
    import simdkalman

    y, nvr = noisy(1000, 1e-3), 1e-5
    kalman = simdkalman.KalmanFilter(
        state_transition=np.array([[1, 1], [0, 1]]),
        process_noise=np.diag([0, nvr]),
        observation_model=np.array([[1, 0]]),
        observation_noise=1.0,
    )
    smoothed = kalman.smooth(y, initial_value=[0, 0], initial_covariance=1e10 * np.eye(2))
    level = diffuse_fit(y, nvr, 2).level
    np.testing.assert_allclose(level, smoothed.observations.mean, atol=1e-8)


@pytest.mark.parametrize(
    ("order", "nvr", "tolerance"), [(2, 1e-8, 1e-11), (3, 1e-11, 1e-8), (4, 1e-12, 1e-8)]
)
def test_small_ratios_keep_their_digits(order, nvr, tolerance):
    y = noisy(3000, 5e-4)
    exact = level_in_extended_precision(y, order, nvr)
    error = np.abs(diffuse_fit(y, nvr, order).level - exact).max()
    assert error < tolerance
    assert error < 0.1 * np.abs(level_by_cholesky(y, order, nvr) - exact).max()


@pytest.mark.parametrize("order", [1, 2, 3, 4])
def test_polynomials_below_the_order_pass_unchanged(order):
    t = np.linspace(-1, 1, 2000)
    polynomial = np.polyval(np.arange(1, order + 1), t)
    np.testing.assert_allclose(diffuse_fit(polynomial, 1e-6, order).level, polynomial, atol=1e-9)


def test_smoothing_of_odd_order_reduces_the_error():
    """A reversed difference kernel would add the noise instead of taking it off."""
    q, _ = point_to_point(5000)
    y = q + 1e-3 * np.random.default_rng(0).standard_normal(q.size)
    level = diffuse_fit(y, 1e-6, 3).level
    assert np.std(level - q) < 0.3 * np.std(y - q)


def test_gradient_formula_agrees_with_finite_differences():
    y, nvr, order = noisy(400, 1e-3), 1e-3, 2
    inverse = np.linalg.inv(omega(y.size, order, nvr))
    z = inverse @ np.diff(y, order)
    variance = diffuse_fit(y, nvr, order).noise_variance
    gradient = nvr / 2 * (np.trace(inverse) - z @ z / variance)
    step = 1e-4
    up, down = (-diffuse_fit(y, nvr * np.exp(s), order).log_likelihood for s in (step, -step))
    assert (up - down) / (2 * step) == pytest.approx(gradient, rel=1e-5)


@pytest.mark.parametrize("order", [2, 3, 4])
def test_search_finds_the_ratio_of_a_simulated_random_walk(order):
    rng = np.random.default_rng(order)
    nvr, samples = 1e-4, 20_000
    level = rng.standard_normal(samples)
    for _ in range(order):
        level = np.cumsum(level)
    found = estimate_nvr(np.sqrt(nvr) * level + rng.standard_normal(samples), RATE, order)
    assert not found.on_bound
    assert abs(np.log10(found.nvr / nvr)) < 0.15


def test_search_ends_where_the_likelihood_is_flat():
    y = noisy(6000, 1e-3)
    best = estimate_nvr(y, RATE, 3).nvr
    top = diffuse_fit(y, best, 3).log_likelihood
    assert all(diffuse_fit(y, best * f, 3).log_likelihood < top for f in (0.97, 1.03))
    assert all(diffuse_fit(y, best * f, 3).log_likelihood > top - 0.1 for f in (0.99, 1.01))


def test_a_record_that_begins_in_noise_is_smoothed_like_one_that_begins_at_rest():
    """Against a filter started at rest, whose start-up error would decide the search."""
    q, _ = point_to_point(20_000)
    noise = 5e-4 * np.random.default_rng(0).standard_normal(q.size)
    fading = np.minimum(np.arange(q.size) / 500, 1)
    whole = estimate_nvr(q + noise, RATE, 3).nvr
    faded = estimate_nvr(q + fading * noise, RATE, 3).nvr
    assert abs(np.log10(whole / faded)) < 0.3


@given(st.floats(-9, 9))
@settings(max_examples=10, deadline=None)
def test_the_ratio_does_not_depend_on_the_unit(exponent):
    y = noisy(2000, 1e-3)
    assert estimate_nvr(10**exponent * y, RATE, 3).nvr == pytest.approx(
        estimate_nvr(y, RATE, 3).nvr, rel=5e-3
    )


def test_cap_of_the_bandwidth_is_a_bound():
    y = noisy(5000, 1e-5)
    free = estimate_nvr(y, RATE, 3)
    capped = estimate_nvr(y, RATE, 3, f50_max=10.0)
    assert not free.on_bound
    assert capped.on_bound
    assert capped.nvr < free.nvr


@pytest.mark.parametrize("value", [0.0, 5.3, 1e6])
def test_constant_record_has_no_noise_to_find(value):
    found = estimate_nvr(np.full(500, value), RATE, 3)
    assert found.on_bound
    assert found.nvr == MAX_NVR
    fit = diffuse_fit(np.full(500, value), found.nvr, 3)
    np.testing.assert_allclose(fit.level, value, rtol=1e-12)


def test_white_noise_alone_is_smoothed_to_the_lower_bound():
    noise = np.random.default_rng(0).standard_normal(5000)
    found = estimate_nvr(noise, RATE, 2)
    assert found.nvr < 100 * MIN_NVR[2]


def test_difference_matrix_and_numpy_agree():
    y = noisy(30, 1.0)
    np.testing.assert_allclose(difference_matrix(30, 3) @ y, np.diff(y, 3))
