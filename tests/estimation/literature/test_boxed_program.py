"""The dual simplex method against HiGHS: rows with ties, rows that contradict each other."""

import numpy as np
import pytest
from scipy.linalg import qr
from scipy.optimize import linprog

from pivident.estimation.literature.boxed_program import basis_of, lower_bound, minimise


def rows_with_ties(seed, size=9, count=150):
    """Small whole numbers, half of the rows twice: more rows than needed meet in a vertex."""
    rng = np.random.default_rng(seed)
    phi = rng.integers(-2, 3, (count, size)).astype(float)
    phi[count // 2 :] = phi[: count - count // 2]
    tau = phi @ rng.integers(-3, 4, size) + rng.integers(-1, 2, count)
    return phi, tau, np.full(count, 2.0)


def independent(phi):
    return basis_of(qr(phi.T, mode="r", pivoting=True)[1][: phi.shape[1]])


@pytest.mark.parametrize("seed", range(6))
def test_minima_are_those_of_another_solver_whatever_the_basis_before(seed):
    phi, tau, bound = rows_with_ties(seed)
    basis = independent(phi)
    rng = np.random.default_rng(seed + 100)
    for cost in (*np.eye(9), *-np.eye(9), *rng.standard_normal((5, 9))):
        assert minimise(phi, tau, bound, cost, basis)
        made = linprog(
            cost, np.vstack([phi, -phi]), np.append(tau + bound, bound - tau), bounds=(None, None)
        )
        assert lower_bound(tau, bound, basis) == pytest.approx(made.fun, rel=1e-8, abs=1e-8)
        assert cost @ basis.theta == pytest.approx(made.fun, rel=1e-8, abs=1e-8)
        assert (np.abs(phi @ basis.theta - tau) <= bound * (1.0 + 1e-9)).all()


def test_the_prices_prove_the_minimum():
    """Of any prices with Σ y a = c, Σ y τ - |y| ε is a lower bound."""
    phi, tau, bound = rows_with_ties(7)
    cost, basis = np.ones(9), independent(phi)
    assert minimise(phi, tau, bound, cost, basis)
    np.testing.assert_allclose(basis.price @ phi[basis.rows], cost, atol=1e-12)
    assert lower_bound(tau, bound, basis) <= cost @ basis.theta + 1e-12
    assert lower_bound(tau, bound, basis) == pytest.approx(cost @ basis.theta, abs=1e-8)


def test_rows_that_contradict_each_other_have_no_minimum():
    phi, tau, bound = rows_with_ties(3)
    phi, tau, bound = np.vstack([phi, phi[:1]]), np.append(tau, tau[0] + 4.5), np.append(bound, 2.0)
    assert not minimise(phi, tau, bound, np.ones(9), independent(phi))


def test_dependent_rows_are_no_basis():
    phi, tau, bound = rows_with_ties(4)
    twice = basis_of(np.append(independent(phi).rows[:8], 0))
    twice.rows[8] = twice.rows[0]
    assert not minimise(phi, tau, bound, np.ones(9), twice)
