"""Networks against least squares, and the scatter that theory gives an adaptive neuron."""

import numpy as np

from pivident.estimation.literature.neural_networks import solve_adaline, solve_hopfield
from pivident.estimation.literature.rows import NormalEquations
from tests.estimation.literature.made_rows import TRUTH, made, rows_of


def noisy(seed, count=2000):
    phi, tau, noise, _ = made(seed, noise=1.0, count=count)
    return rows_of(phi, [t + e for t, e in zip(tau, noise, strict=True)])


def test_hopfield_arrives_at_least_squares():
    rows = noisy(0)
    least = NormalEquations.of(rows.sums(), 4)
    found = solve_hopfield(rows, np.zeros(4), 10.0, 1e3)
    std = np.sqrt(np.diag(least.inverse))
    assert found.converged and (np.abs(found.theta - least.solution) < 0.02 * std).all()
    early = solve_hopfield(rows, np.zeros(4), 10.0, 0.5)
    assert not early.converged


def test_hopfield_does_not_depend_on_the_unit_of_the_torque():
    phi, tau, noise, _ = made(0, noise=1.0, count=2000)
    passes = []
    for unit in (1.0, 1e-9, 1e9):
        rows = rows_of(phi, [unit * (t + e) for t, e in zip(tau, noise, strict=True)])
        found = solve_hopfield(rows, np.zeros(4), 10.0, 1e6)
        least = NormalEquations.of(rows.sums(), 4).solution
        np.testing.assert_allclose(found.theta, least, rtol=1e-6)
        passes.append(len(found.iterations))
    assert max(passes) < 1000 and np.ptp(passes) <= 2


def test_adaline_scatters_around_the_truth_as_theory_says():
    errors, std, least = [], [], []
    for seed in range(120):
        rows = noisy(seed)
        found = solve_adaline(rows, np.zeros(4), 0.2, 3)
        assert found.converged
        errors.append(found.theta - TRUTH)
        std.append(np.sqrt(np.diag(found.covariance)))
        least.append(NormalEquations.of(rows.sums(), 4).solution - TRUTH)
    spread = np.std(errors, axis=0)
    np.testing.assert_allclose(np.mean(std, axis=0), spread, rtol=0.25)
    assert (spread > 3.0 * np.std(least, axis=0)).all()


def test_adaline_that_has_not_gone_far_enough_says_so():
    assert not solve_adaline(noisy(0, 100), np.zeros(4), 0.01, 1).converged
