"""Sums of products of rows beside numpy's matrix product."""

import numpy as np
import pytest

from pivident.estimation.covariance.windows import windows_of
from pivident.estimation.normal_equations import JointSums, gram, products


@pytest.mark.parametrize("rows", [1, 3, 4, 7, 21])
def test_products_are_those_of_numpy(rows):
    rng = np.random.default_rng(rows)
    x, y = rng.standard_normal((rows, 1300)), rng.standard_normal((5, 700))
    np.testing.assert_allclose(
        gram(x, slice(10, 1290)), x[:, 10:1290] @ x[:, 10:1290].T, rtol=0, atol=1e-11
    )
    np.testing.assert_allclose(
        products(y, x, slice(100, 800)), y @ x[:, 100:800].T, rtol=0, atol=1e-11
    )


def test_a_gram_matrix_is_symmetric_to_the_last_bit():
    found = gram(np.random.default_rng(0).standard_normal((9, 999)), slice(None))
    np.testing.assert_array_equal(found, found.T)


def test_nan_is_not_lost():
    x = np.ones((6, 40))
    x[2, 7] = np.nan
    assert np.isnan(gram(x, slice(None))[2]).all()


def test_windows_share_out_the_sums():
    rng = np.random.default_rng(1)
    phi, z, tau = rng.standard_normal((3, 4, 1000))
    (windows,) = windows_of([1000])
    votes = rng.random(1000) < 0.7
    sums = JointSums.empty("axis", np.arange(4), windows.count)
    sums.add(phi, z, tau[0], votes, list(windows.shares(slice(0, 1000))))
    voting = z[:, votes] @ phi[:, votes].T
    np.testing.assert_allclose(sums.zf, voting, atol=1e-11)
    np.testing.assert_allclose(sums.window_zf.sum(axis=0), voting, atol=1e-11)
    np.testing.assert_allclose(sums.window_zt.sum(axis=0), z[:, votes] @ tau[0, votes], atol=1e-11)
    assert sums.rows == votes.sum()
