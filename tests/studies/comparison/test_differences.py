"""Differences: their intervals hold whatever the correlation, marks keep their level."""

import math

import numpy as np
import pytest
from hypothesis import given, strategies as st

from pivident.studies.comparison.compared_results import Estimate, difference, holm


def symmetric(value, std):
    return Estimate(value, value - 2 * std, value + 2 * std)


def test_independent_errors_add_in_squares_and_unknown_ones_in_full():
    a, b = symmetric(1.0, 0.3), symmetric(3.0, 0.4)
    independent, unknown = (difference(a, b, independent=i) for i in (True, False))
    assert independent.value == unknown.value == 2.0
    assert independent.spread == pytest.approx(2 * 0.5)
    assert unknown.spread == pytest.approx(2 * 0.7)
    assert independent.z == pytest.approx(4.0) and unknown.z == pytest.approx(2.0 / 0.7)
    assert independent.p_value == pytest.approx(math.erfc(4.0 / math.sqrt(2.0)))
    assert independent.relative == pytest.approx(200.0)


def test_intervals_that_are_not_symmetric_keep_their_sides():
    a, b = Estimate(1.0, 0.4, 3.0), Estimate(2.0, 1.2, 2.3)
    found = difference(a, b, independent=True)
    assert found.low == pytest.approx(1.0 - math.hypot(0.8, 2.0))
    assert found.high == pytest.approx(1.0 + math.hypot(0.3, 0.6))
    assert found.z == pytest.approx(2.0 / math.hypot(0.8, 2.0)), "the side of zero counts"


def test_without_an_interval_there_is_no_test():
    found = difference(Estimate(1.0, math.nan, math.nan), symmetric(2.0, 0.1), independent=True)
    assert found.value == 1.0
    assert math.isnan(found.z) and math.isnan(found.p_value) and math.isnan(found.low)


@given(st.floats(-1, 1), st.floats(1e-3, 10), st.floats(1e-3, 10))
def test_the_interval_for_unknown_correlation_is_never_too_narrow(rho, s, t):
    true = math.sqrt(max(s**2 + t**2 - 2 * rho * s * t, 0.0))
    found = difference(symmetric(0.0, s), symmetric(1.0, t), independent=False)
    assert found.spread >= 2.0 * true - 1e-9


def test_holm_by_hand():
    p = np.array([0.01, np.nan, 0.04, 0.03, 0.005])
    expected = [0.03, np.nan, 0.06, 0.06, 0.02]
    np.testing.assert_allclose(holm(p), expected)
    assert holm(np.array([0.5, 0.9])).max() == 1.0


@pytest.mark.parametrize(("correlation", "independent"), [(0.0, True), (-0.9, False), (0.7, False)])
def test_false_marks_are_as_rare_as_promised(correlation, independent):
    rng = np.random.default_rng(5)
    runs, parameters, level = 500, 13, 0.05
    mix = np.linalg.cholesky([[1.0, correlation], [correlation, 1.0]])
    errors = np.einsum("ij,rpj->rpi", mix, rng.standard_normal((runs, parameters, 2)))
    marked = 0
    for run in errors:
        p = [
            difference(symmetric(a, 1.0), symmetric(b, 1.0), independent=independent).p_value
            for a, b in run
        ]
        marked += bool((holm(np.array(p)) <= level).any())
    assert marked / runs <= level + 3 * math.sqrt(level * (1 - level) / runs)
    if independent:
        assert marked / runs > 0.01, "Holm is hardly conservative for independent tests"
