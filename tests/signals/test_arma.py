"""Noise models against statsmodels' exact likelihood, and where others give up."""

import time
import warnings

import numpy as np
import pytest
from scipy.signal import lfilter

from pivident.foundation.errors import IdentificationError
from pivident.signals.arma import MAX_ROOT, ar, arma, inside, select_arma
from pivident.signals.arma_likelihood import Likelihood

PROCESSES = {
    "AR(2)": ([1, -1.5, 0.8], [1]),
    "ARMA(2, 2)": ([1, -1.5, 0.8], [1, 0.5, 0.3]),
    "ARMA(1, 1)": ([1, -0.3], [1, -0.95]),
    "zero at 0.98": ([1], [1, -0.98]),
    "zero at 1": ([1], [1, -1]),
}


def noise(d, c, samples, seed=1):
    e = np.random.default_rng(seed).standard_normal(samples + 500)
    return lfilter(c, d, e)[500:]


@pytest.mark.parametrize("name", PROCESSES)
def test_agrees_with_the_exact_likelihood_of_statsmodels(name):
    from statsmodels.tsa.arima.model import ARIMA

    d, c = PROCESSES[name]
    v = noise(d, c, 1500)
    p, q = len(d) - 1, len(c) - 1
    ours = arma(v, p, q)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        theirs = ARIMA(v, order=(p, 0, q), trend="c").fit()
    assert not ours.warnings
    difference = np.r_[ours.ar[1:] + theirs.arparams, ours.ma[1:] - theirs.maparams]
    assert np.abs(difference / np.sqrt(np.diag(ours.covariance))).max() < 0.2
    assert abs(ours.variance / theirs.params[-1] - 1) < 0.2 * np.sqrt(2 / v.size)
    if name != "zero at 1":  # there no deviation is defined
        assert np.allclose(np.sqrt(np.diag(ours.covariance)), theirs.bse[1:-1], rtol=0.15)


def test_likelihood_is_that_of_the_multivariate_normal_distribution():
    """Exact for a pure MA model: compare with the density by its covariance matrix."""
    from scipy.linalg import toeplitz

    c, samples = np.array([1.0, -1.7, 0.75]), 60
    v = noise([1], c, samples)
    point = Likelihood(v, np.array([[0, samples]]), 0).at(np.r_[c[1:], 0.0])
    covariance = toeplitz(np.r_[np.correlate(c, c, "full")[2:], np.zeros(samples - 3)])
    squares = v @ np.linalg.solve(covariance, v)
    assert point.variance * samples == pytest.approx(squares, rel=1e-10)
    assert point.log_det == pytest.approx(np.linalg.slogdet(covariance)[1], rel=1e-9)


def test_gradient_is_that_of_the_likelihood():
    v = noise([1, -1.5, 0.8], [1, -1.2, 0.5], 400)
    likelihood = Likelihood(v, np.array([[0, 150], [170, 400]]), 2)
    theta = np.array([-1.4, 0.7, -1.1, 0.4, 0.05])
    gradient = likelihood.at(theta)._slope()[0]
    for i in range(theta.size):
        h = np.zeros(theta.size)
        h[i] = 1e-5
        numeric = (likelihood.at(theta + h).value - likelihood.at(theta - h).value) / 2e-5
        assert gradient[i] == pytest.approx(numeric, rel=1e-5, abs=1e-4)


@pytest.mark.parametrize("d", [[1.0], [1, -1.5, 0.8]])
def test_doubly_differenced_white_noise(d):
    v = noise(d, [1, -2, 1], 5000)
    found = arma(v, len(d) - 1, 2)
    assert not found.warnings
    assert np.abs(np.roots(found.ma)).max() <= MAX_ROOT + 1e-9
    assert found.variance == pytest.approx(1.0, abs=5 * np.sqrt(2 / 5000))
    assert np.allclose(found.ma, [1, -2, 1], atol=0.03)


def test_gaps_are_not_bridged():
    """Two stretches of one process with a wild part between them give its model."""
    v = noise([1, -1.5, 0.8], [1, 0.5], 6000)
    broken = v.copy()
    broken[3000:3100] = 1e6
    found = arma(broken, 2, 1, segments=np.array([[0, 3000], [3100, 6000]]))
    whole = arma(v, 2, 1)
    assert np.allclose(found.ar, whole.ar, atol=5e-3)
    assert np.allclose(found.ma, whole.ma, atol=2e-2)


def test_deviations_are_those_of_repetition():
    d, c = [1, -0.9], [1, 0.4]
    found = [arma(noise(d, c, 500, seed), 1, 1) for seed in range(150)]
    values = np.array([np.r_[m.ar[1:], m.ma[1:]] for m in found])
    stated = np.mean([np.sqrt(np.diag(m.covariance)) for m in found], axis=0)
    assert np.all(np.abs(values.std(axis=0) / stated - 1) < 0.25)
    assert np.all(np.abs(values.mean(axis=0) - [-0.9, 0.4]) < 0.02)


def test_ar_has_the_covariance_of_statsmodels():
    from statsmodels.tsa.ar_model import AutoReg

    v = noise([1, -1.2, 0.8], [1], 4000)
    ours, theirs = ar(v, 2), AutoReg(v, 2, trend="c").fit()
    assert np.allclose(ours.covariance, theirs.cov_params()[1:, 1:], rtol=0.02)


def test_orders_are_found():
    v = noise([1, -1.5, 0.8], [1, 0.7], 8000)
    found = select_arma(v, range(4), range(3), "bic")
    assert (found.ar.size - 1, found.ma.size - 1) == (2, 1)


def test_cancelling_pole_and_zero_give_a_model_that_whitens():
    v = noise([1], [1], 3000)
    found = arma(v, 3, 3)
    assert found.variance == pytest.approx(v.var(), rel=0.02)


def test_a_long_record_takes_a_moment():
    v = noise([1, -1.5, 0.8], [1, 0.5, 0.3], 50_000)
    arma(v[:1000], 2, 2)
    begin = time.process_time()
    arma(v, 2, 2)
    assert time.process_time() - begin < 0.3  # 0.03 s on a quiet machine


def test_roots_are_reflected():
    assert np.allclose(inside(np.array([1.0, -2.0])), [1.0, -0.5])
    assert np.allclose(inside(np.array([1.0, -2.0]), reflect=False), [1.0, -MAX_ROOT])
    assert np.array_equal(inside(np.array([1.0, -0.5, 0.0])), [1.0, -0.5, 0.0])


@pytest.mark.parametrize(
    ("v", "orders", "words"),
    [
        (np.ones(500), (1, 1), "constant"),
        (np.r_[np.nan, np.ones(499)], (1, 1), "NaN"),
        (np.arange(20.0), (2, 2), "longer record"),
        (np.zeros((50, 2)), (1, 1), "shape"),
        (np.arange(500.0), (-1, 1), "negative"),
    ],
)
def test_what_cannot_be_modelled_is_said(v, orders, words):
    with pytest.raises(IdentificationError, match=words):
        arma(v, *orders)
