"""Robust regression against statsmodels, its limit and outliers."""

import numpy as np
import pytest
import statsmodels.api as sm

from pivident.estimation.literature.robust_regression import scales, slope, solve_robust, weight
from pivident.estimation.literature.rows import NormalEquations, Rows
from tests.estimation.literature.made_rows import TRUTH, made, rows_of

NORMS = {"huber": sm.robust.norms.HuberT(1.345), "bisquare": sm.robust.norms.TukeyBiweight(4.685)}


@pytest.mark.parametrize("loss", ["huber", "bisquare"])
def test_weights_and_slopes_are_those_of_the_loss(loss):
    u = np.linspace(-8.0, 8.0, 161)
    np.testing.assert_allclose(weight(u, loss), NORMS[loss].weights(u), atol=1e-12)
    np.testing.assert_allclose(slope(u, loss), NORMS[loss].psi_deriv(u), atol=1e-12)


@pytest.mark.parametrize("loss", ["huber", "bisquare"])
def test_one_joint_is_what_statsmodels_finds(loss):
    phi, tau, noise, rng = made(count=600)
    noise = noise[0] + (rng.random(600) < 0.1) * rng.normal(size=600) * 3.0
    whole = rows_of(phi, [tau[0] + noise, tau[1]])
    own = whole.joints[0]
    rows = Rows((own,), 3, whole.root[:1], whole.lengths)
    start = np.linalg.lstsq(own.phi.T, own.tau, rcond=None)[0]
    found = solve_robust(rows, start, loss, 1e-8, 200)
    other = sm.RLM(own.tau, own.phi.T, M=NORMS[loss])
    # from our estimate, whose start was Huber's: the bisquare's minimum is not the only one
    result = other.fit(
        scale_est="mad",
        start_params=found.theta, maxiter=200, tol=1e-10, conv="coefs",
    )  # fmt: skip
    # statsmodels takes the deviation from the median, here the median of the absolute values
    assert found.converged
    np.testing.assert_allclose(found.theta, result.params, atol=0.05 * result.bse.min())
    np.testing.assert_allclose(np.sqrt(np.diag(found.covariance)), result.bse, rtol=0.03)


def test_without_outliers_it_is_nearly_least_squares_and_with_them_far_better():
    phi, tau, noise, rng = made(3)
    clean = rows_of(phi, [t + e for t, e in zip(tau, noise, strict=True)])
    least = NormalEquations.of(clean.sums(), clean.size)
    found = solve_robust(clean, least.solution, "huber", 1e-3, 50)
    std = 0.1 * np.sqrt(np.diag(least.inverse))
    assert (np.abs(found.theta - least.solution) < std).all()
    np.testing.assert_allclose(np.sqrt(np.diag(found.covariance)), std, rtol=0.1)
    spikes = (rng.random(noise.shape) < 0.05) * 20.0
    spoiled = rows_of(phi, [t + e + s for t, e, s in zip(tau, noise, spikes, strict=True)])
    start = NormalEquations.of(spoiled.sums(), spoiled.size).solution
    for loss in ("huber", "bisquare"):
        mended = solve_robust(spoiled, start, loss, 1e-3, 100)
        assert np.abs(mended.theta - TRUTH).max() < 0.2 * np.abs(start - TRUTH).max()
        z = (mended.theta - TRUTH) / np.sqrt(np.diag(mended.covariance))
        assert np.abs(z).max() < 4.0


def test_scales_are_deviations_of_normal_errors():
    rng = np.random.default_rng(1)
    errors = rng.normal(size=(2, 40000)) * [[0.3], [2.0]]
    found = scales(errors, np.ones(errors.shape, bool))
    np.testing.assert_allclose(found, [0.3, 2.0], rtol=0.02)
