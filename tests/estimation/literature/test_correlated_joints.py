"""Maximum likelihood with correlated joints against generalised least squares."""

import numpy as np
import statsmodels.api as sm

from pivident.estimation.literature.correlated_joints import joint_covariance, solve_correlated
from pivident.estimation.literature.rows import NormalEquations
from tests.estimation.literature.made_rows import TRUTH, made, rows_of, stacked

NOISE = np.array([[1.0, 1.8], [1.8, 4.0]])


def correlated(seed, count=400):
    phi, tau, _, rng = made(seed, count=count)
    noise = np.linalg.cholesky(NOISE) @ rng.normal(size=(2, count))
    return phi, [t + e for t, e in zip(tau, noise, strict=True)], rng


def test_it_is_generalised_least_squares_with_its_own_covariance():
    phi, tau, _ = correlated(0)
    rows = rows_of(phi, tau)
    found = solve_correlated(rows, TRUTH, 1e-9, 100)
    dense, torque = stacked(rows)
    noise = joint_covariance(rows.residuals(found.theta), np.ones((2, 400), bool), 4)
    other = sm.GLS(torque, dense, np.kron(noise, np.eye(400))).fit()
    assert found.converged
    np.testing.assert_allclose(found.theta, other.params, rtol=1e-7)
    np.testing.assert_allclose(found.covariance, other.normalized_cov_params, rtol=1e-6)
    np.testing.assert_allclose(noise, NOISE, rtol=0.2)


def test_it_is_more_precise_than_weighted_least_squares_and_its_intervals_are_true():
    errors, std, least = [], [], []
    for seed in range(200):
        phi, tau, rng = correlated(seed, 150)
        used = rng.random((2, 150)) < 0.9
        rows = rows_of(phi, tau, used, root=(1.0, 2.0))
        found = solve_correlated(rows, TRUTH, 1e-3, 50)
        errors.append(found.theta - TRUTH)
        std.append(np.sqrt(np.diag(found.covariance)))
        least.append(NormalEquations.of(rows.sums(), 4).solution - TRUTH)
    spread = np.std(errors, axis=0)
    assert (spread < 0.85 * np.std(least, axis=0)).all()
    np.testing.assert_allclose(np.mean(std, axis=0), spread, rtol=0.15)
    assert 0.93 < np.mean(np.abs(errors) < 2.0 * np.array(std)) < 0.975
