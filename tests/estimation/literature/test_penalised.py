"""Ridge and prior against closed forms, limits and Monte Carlo."""

import numpy as np
import pytest

from pivident.estimation.literature.penalised_regression import (
    contradiction,
    solve_ridge,
    solve_with_prior,
)
from pivident.estimation.literature.rows import NormalEquations
from tests.estimation.literature.made_rows import TRUTH, made, rows_of, stacked


@pytest.fixture(scope="module")
def rows():
    phi, tau, noise, _ = made(noise=1.0, count=200)
    return rows_of(phi, [t + e for t, e in zip(tau, noise, strict=True)])


def test_ridge_is_least_squares_with_rows_for_the_penalty(rows):
    dense, torque = stacked(rows)
    found, penalty = solve_ridge(rows, 0.03)
    scale = np.linalg.norm(dense, axis=0)
    more = np.vstack([dense, np.sqrt(0.03) * np.diag(scale)])
    expected = np.linalg.lstsq(more, np.append(torque, np.zeros(rows.size)), rcond=None)[0]
    np.testing.assert_allclose(found.theta, expected, rtol=1e-9)
    inverse = np.linalg.inv(more.T @ more)
    np.testing.assert_allclose(found.covariance, inverse @ dense.T @ dense @ inverse, rtol=1e-8)
    assert penalty == 0.03


def test_the_penalty_minimises_generalised_cross_validation(rows):
    dense, torque = stacked(rows)
    _, penalty = solve_ridge(rows, None)
    scale = np.linalg.norm(dense, axis=0)

    def criterion(k):
        hat = dense @ np.linalg.solve(dense.T @ dense + k * np.diag(scale**2), dense.T)
        error = torque - hat @ torque
        return error @ error / (torque.size - np.trace(hat)) ** 2

    grid = np.geomspace(1e-10, 1e2, 241)
    assert penalty == pytest.approx(grid[np.argmin([criterion(k) for k in grid])], rel=0.12)


def test_a_flat_prior_is_least_squares_and_a_sharp_one_is_itself(rows):
    least = NormalEquations.of(rows.sums(), rows.size)
    flat = solve_with_prior(rows, np.full(4, 7.0), np.zeros((4, 4)))
    np.testing.assert_allclose(flat.theta, least.solution, rtol=1e-10)
    np.testing.assert_allclose(flat.covariance, least.inverse, rtol=1e-9)
    sharp = solve_with_prior(rows, TRUTH + 0.1, 1e12 * np.eye(4))
    np.testing.assert_allclose(sharp.theta, TRUTH + 0.1, rtol=1e-6)


def test_posterior_intervals_hold_the_truth_as_often_as_they_say():
    # truths drawn from the prior
    rng = np.random.default_rng(5)
    prior = np.array([[0.09, 0.03, 0.0, 0.0], [0.03, 0.04, 0.0, 0.0],
                      [0.0, 0.0, 0.01, 0.0], [0.0, 0.0, 0.0, 0.25]])  # fmt: skip
    root, inside, robust = np.linalg.cholesky(prior), [], []
    for seed in range(250):
        phi, _, noise, _ = made(seed, noise=1.0, count=60)
        truth = TRUTH + root @ rng.normal(size=4)
        tau = [truth[c] @ own for c, own in zip(([0, 1, 2], [1, 2, 3]), phi, strict=True)]
        rows = rows_of(phi, [t + e for t, e in zip(tau, noise, strict=True)])
        found = solve_with_prior(rows, TRUTH, np.linalg.inv(prior))
        error = np.abs(found.theta - truth)
        inside.append(error < 2.0 * np.sqrt(np.diag(found.covariance)))
        robust.append(error < 2.0 * np.sqrt(np.diag(found.robust)))
    assert 0.93 < np.mean(inside) < 0.975
    assert 0.91 < np.mean(robust) < 0.985


def test_data_that_contradict_the_prior_are_far_from_it(rows):
    deviation = np.array([0.01, 0.01, np.inf, 0.01])
    apart = contradiction(rows, TRUTH + np.array([0.0, 1.5, 9.0, 0.0]), deviation)
    assert abs(apart[1]) > 8.0 and abs(apart[0]) < 4.0 and apart[2] == 0.0
