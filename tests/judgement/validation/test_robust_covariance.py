"""Robust covariances against statsmodels, against sums over lags, and against Monte Carlo."""

import numpy as np
import pytest
from benchmarks import score_covariances
from benchmarks.score_covariances import (
    Scores,
    andrews_lags,
    block_bootstrap,
    long_run_sum,
    newey_west,
    robust_covariances,
    scores_of,
    taper_of,
    tapered_sums,
)
from scipy.signal import lfilter

from pivident.estimation.identify import identify
from pivident.experiment.simulated_tx40 import tx40_scenario
from pivident.foundation.errors import IdentificationError


def regression(seed=0, samples=400):
    rng = np.random.default_rng(seed)
    x = np.column_stack([np.ones(samples), rng.normal(size=(samples, 2)).cumsum(axis=0) / 10])
    error = lfilter([1.0], [1.0, -0.6], rng.normal(size=samples)) * (1 + np.abs(x[:, 1]))
    return x, x @ [1.0, -2.0, 0.5] + error


@pytest.fixture(scope="module")
def found():
    problem, _ = tx40_scenario("fine", seed=1, samples=12000)
    return identify(problem, "iv-full-rate")


def test_white_and_newey_west_agree_with_statsmodels():
    sm = pytest.importorskip("statsmodels.api")
    x, y = regression()
    fit = sm.OLS(y, x).fit()
    scores = Scores.from_rows(x, x, y - x @ fit.params)
    assert np.allclose(
        scores.covariance(scores.white), fit.get_robustcov_results("HC0").cov_params()
    )
    assert np.allclose(
        scores.covariance(scores.white_hc3), fit.get_robustcov_results("HC3").cov_params()
    )
    for lags in (1, 7, 60):
        expected = fit.get_robustcov_results("HAC", maxlags=lags).cov_params()
        assert np.allclose(newey_west(scores, lags), expected)


def test_newey_west_with_instruments_agrees_with_linearmodels():
    iv = pytest.importorskip("linearmodels.iv")
    x, y = regression()
    rng = np.random.default_rng(1)
    z = x + 0.2 * rng.normal(size=x.shape)
    fit = iv.IV2SLS(y, None, x, z).fit(
        cov_type="kernel", kernel="bartlett", bandwidth=12, debiased=False
    )
    theta = np.linalg.solve(z.T @ x, z.T @ y)
    scores = Scores.from_rows(x, z, y - x @ theta)
    assert np.allclose(newey_west(scores, 12), fit.cov, rtol=1e-6)


def test_a_taper_is_a_kernel_over_lags():
    rng = np.random.default_rng(2)
    scores = rng.normal(size=(200, 2))
    taper = taper_of("raised cosine", 9)
    kernel = np.correlate(taper, taper, "full")[8:] / np.sum(taper**2)
    expected = scores.T @ scores
    for lag in range(1, 9):
        gamma = scores[lag:].T @ scores[:-lag]
        expected = expected + kernel[lag] * (gamma + gamma.T)
    assert np.allclose(long_run_sum([scores], 9, "raised cosine"), expected)
    assert tapered_sums(scores, taper).shape == (208, 2)


def test_andrews_follows_the_correlation():
    rng = np.random.default_rng(3)
    rho, samples = 0.5, 20000
    ones = np.ones((samples, 1))
    noise = lfilter([1.0], [1.0, -rho], rng.normal(size=samples))
    alpha = 4 * rho**2 / ((1 - rho) ** 2 * (1 + rho) ** 2)
    expected = 1.1447 * (alpha * samples) ** (1 / 3)
    assert andrews_lags(Scores.from_rows(ones, ones, noise)) == pytest.approx(expected, rel=0.1)
    white = Scores.from_rows(ones, ones, rng.normal(size=samples))
    assert andrews_lags(white) < 5


def monte_carlo(make_noise, runs=300, samples=3000):
    """Spread of an estimate over the deviations that each covariance gives for it."""
    rng = np.random.default_rng(4)
    x = np.sin(2 * np.pi * np.arange(samples) / 100)[:, None]
    theta, found = [], []
    for _ in range(runs):
        error = make_noise(rng, samples)
        theta.append(float(x[:, 0] @ error / np.sum(x**2)))
        scores = Scores.from_rows(x, x, error - theta[-1] * x[:, 0])
        found.append(
            [
                scores.covariance(scores.white)[0, 0],
                newey_west(scores, 117)[0, 0],
                scores.covariance(long_run_sum(scores.records, 118, "raised cosine"))[0, 0],
                block_bootstrap(scores, 118, 100).covariance[0, 0],
            ]
        )
    return np.sqrt(np.mean(found, axis=0)) / np.std(theta)


def test_correlation_that_white_misses():
    white, flat, smooth, bootstrap = monte_carlo(
        lambda rng, n: lfilter([1.0], [1.0, -0.95], rng.normal(size=n))
    )
    assert white > 1.2 or white < 0.8
    assert np.allclose([flat, smooth, bootstrap], 1.0, atol=0.2)


def test_edges_leak_where_the_noise_is_differentiated():
    white, flat, smooth, bootstrap = monte_carlo(lambda rng, n: np.diff(rng.normal(size=n + 2), 2))
    assert white > 10 and flat > 2 * smooth
    assert smooth < 2.5 and bootstrap < 2.5


def test_the_bootstrap_has_the_covariance_of_its_windows():
    x, y = regression()
    theta = np.linalg.lstsq(x, y, rcond=None)[0]
    scores = Scores.from_rows(x, x, y - x @ theta)
    drawn = block_bootstrap(scores, 20, draws=20000, seed=1)
    expected = scores.covariance(long_run_sum(scores.records, 20, "raised cosine"))
    assert np.allclose(drawn.covariance, expected, rtol=0.1, atol=0.05 * np.abs(expected).max())
    low, high = drawn.interval(theta)
    width = (high - low) / np.sqrt(np.diag(expected))
    assert np.allclose(width, 4.0, atol=0.25)
    assert np.array_equal(drawn.steps, block_bootstrap(scores, 20, 20000, seed=1).steps)


def test_blocks_must_fit_into_a_record():
    x, y = regression()
    scores = Scores.from_rows(x, x, y)
    with pytest.raises(IdentificationError, match="between 1 and 400"):
        block_bootstrap(scores, 401)


def test_scores_of_an_estimate_sum_to_zero(found):
    scores = scores_of(found)
    (values,) = scores.records
    assert values.shape == (12000, 28) and scores.thinning == 1
    assert np.abs(values.sum(axis=0)).max() < 1e-6 * np.abs(values).sum(axis=0).max()
    assert np.allclose(scores.white, values.T @ values)


def test_memory_is_bounded_by_summing_neighbours(found, monkeypatch):
    whole = scores_of(found)
    monkeypatch.setattr(score_covariances, "MAX_ROWS", 5000)
    thin = scores_of(found)
    assert thin.thinning == 3 and thin.rows == 4000
    assert np.allclose(thin.records[0], whole.records[0].reshape(4000, 3, 28).sum(axis=1))
    assert np.allclose(thin.white, whole.white)


def test_all_covariances_of_an_identification(found):
    every = robust_covariances(found, draws=200)
    assert np.allclose(every.std(), found.robust_std)
    assert every.ratio("formula") > 2  # unfiltered residuals are not white at all
    for name in ("smooth", "bootstrap", "newey_west"):
        assert 0.7 < every.ratio(name) < 1.3
    assert every.andrews_lags < every.lags
    assert "Newey-West" in str(every)
