"""Tails and quantiles against those of SciPy."""

import numpy as np
import pytest
import scipy.stats

from pivident.foundation.distributions import chi_square, fisher, normal, student

POINTS = np.array([-1.0, 0.0, 1e-9, 0.3, 1.0, 2.5, 10.0, 400.0, np.inf, np.nan])
CHANCES = np.array([1e-12, 1e-3, 0.3, 0.5, 0.975, 1.0 - 1e-12, np.nan])
FREEDOM = [1, 2, 5.5, 100, 0, -1, np.nan]


@pytest.mark.parametrize("freedom", FREEDOM)
@pytest.mark.parametrize(
    ("own", "theirs"), [(chi_square, scipy.stats.chi2), (student, scipy.stats.t)]
)
def test_chi_square_and_student(own, theirs, freedom):
    for tail in ("sf", "cdf"):
        np.testing.assert_allclose(
            getattr(own, tail)(POINTS, freedom), getattr(theirs, tail)(POINTS, freedom), rtol=1e-12
        )
    for quantile in ("ppf", "isf"):
        np.testing.assert_allclose(
            getattr(own, quantile)(CHANCES, freedom),
            getattr(theirs, quantile)(CHANCES, freedom), rtol=1e-12,
        )  # fmt: skip


@pytest.mark.parametrize("above", FREEDOM)
@pytest.mark.parametrize("below", [1, 7.5, 1e6])
def test_fisher(above, below):
    np.testing.assert_allclose(
        fisher.sf(POINTS, above, below), scipy.stats.f.sf(POINTS, above, below), rtol=1e-12
    )
    np.testing.assert_allclose(
        fisher.ppf(CHANCES, above, below), scipy.stats.f.ppf(CHANCES, above, below), rtol=1e-12
    )


def test_normal():
    np.testing.assert_allclose(normal.sf(POINTS), scipy.stats.norm.sf(POINTS), rtol=1e-12)
    np.testing.assert_allclose(normal.cdf(POINTS), scipy.stats.norm.cdf(POINTS), rtol=1e-12)
    np.testing.assert_allclose(normal.ppf(CHANCES), scipy.stats.norm.ppf(CHANCES), rtol=1e-12)
    assert isinstance(float(normal.sf(1.0)), float)
