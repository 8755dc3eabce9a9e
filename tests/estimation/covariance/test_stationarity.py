"""The covariance that the data decide on, on jackknives whose truth is known."""

import numpy as np
import pytest

from pivident.estimation.covariance.sandwich import Jackknife, jackknife_of
from pivident.estimation.covariance.stationary_noise import covariance_by_test
from pivident.estimation.covariance.windows import OVERLAP

TRUE = np.diag([1.0, 4.0, 0.25, 9.0])


def windows(rng, spread=1.0, count=30, nu=20.0):
    """Steps whose covariance is TRUE times ``spread`` on average."""
    size = np.sqrt(spread * OVERLAP / count) * np.sqrt(np.diag(TRUE))
    return Jackknife(size * rng.standard_normal((count, 4)), np.full(4, nu))


def accepted(spread, **options):
    """Share of 300 records on which the stationary covariance is reported."""
    rng = np.random.default_rng(2)
    return np.mean([covariance_by_test(TRUE, windows(rng, spread, **options)) is TRUE
                    for _ in range(300)])  # fmt: skip


def test_stationary_noise_is_taken_for_it():
    assert accepted(1.0) > 0.95


def test_windows_count_where_they_find_more():
    assert accepted(3.0) < 0.02
    found = windows(np.random.default_rng(3), 3.0)
    np.testing.assert_array_equal(covariance_by_test(TRUE, found), found.covariance)


def test_the_wider_counts_where_windows_are_too_few_to_decide():
    rng = np.random.default_rng(4)
    for _ in range(20):
        own = windows(rng, count=6, nu=4.0)
        reported = covariance_by_test(TRUE, own)
        wider = np.maximum(np.diag(TRUE), np.diag(own.covariance))
        np.testing.assert_allclose(np.diag(reported), wider)
        spread = np.sqrt(np.diag(reported))
        other = np.sqrt(np.diag(own.covariance))
        np.testing.assert_allclose(
            reported / np.outer(spread, spread), own.covariance / np.outer(other, other)
        )


@pytest.mark.parametrize(("shares", "windows"), [(np.ones(10), 10.0), (np.eye(10)[3] + 1e-9, 1.0)])
def test_degrees_of_freedom_count_the_windows_that_tell_a_parameter(shares, windows):
    zf = shares[:, None, None] * np.eye(2)
    total = 2.0 * zf.sum(axis=0)  # as much is known besides
    found = jackknife_of(zf, np.ones((10, 2)), total)
    np.testing.assert_allclose(
        found.degrees_of_freedom, windows / (1.0 + 2.0 / 36.0) - 1.0, atol=1e-6
    )
