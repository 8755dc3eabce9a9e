"""Level, slope and scatter against closed forms and dense least squares."""

from dataclasses import replace

import numpy as np
import pytest

from pivident.studies.many.fleet.baseline import fit_baseline, paule_mandel
from tests.studies.many.fleet.series import drawn


def dense(series, scatter):
    """Weighted least squares with a column for each robot and one for temperature."""
    first = series[0].baseline
    rows, y, w = [], [], []
    for r, s in enumerate(series):
        for k in range(first):
            rows.append([*np.eye(len(series))[r], s.temperature[k]])
            y.append(s.value[k])
            w.append(1.0 / (scatter**2 + s.std[k] ** 2))
    x, y, w = np.array(rows), np.array(y), np.array(w)
    covariance = np.linalg.inv(x.T @ (w[:, None] * x))
    return covariance @ x.T @ (w * y), covariance, w @ (y - x @ (covariance @ x.T @ (w * y))) ** 2


def test_scatter_of_equally_good_records_is_the_excess_of_their_variance():
    rng = np.random.default_rng(0)
    series = [replace(s, std=np.full(6, 0.01)) for s in drawn(rng, robots=5)]
    own = np.array([s.value[:3] for s in series])
    pooled = ((own - own.mean(axis=1, keepdims=True)) ** 2).sum() / (5 * 2)
    found = fit_baseline(series, relative=False)
    assert found.degrees == 10
    assert found.scatter**2 == pytest.approx(pooled - 0.01**2, rel=1e-9)


def test_records_that_scatter_less_than_their_intervals_have_no_further_scatter():
    series = [replace(s, std=np.ones(6)) for s in drawn(np.random.default_rng(1))]
    assert fit_baseline(series).scatter == 0.0


def test_level_slope_and_expectation_are_those_of_dense_least_squares():
    series = drawn(np.random.default_rng(2), warmth=-0.02)
    found = fit_baseline(series, relative=False)
    theta, covariance, q = dense(series, found.scatter)
    assert found.degrees == 6 * 3 - 6 - 1
    assert q == pytest.approx(found.degrees, rel=1e-9)
    assert found.temperature.slope == pytest.approx(theta[-1], rel=1e-9)
    assert found.temperature.std == pytest.approx(np.sqrt(covariance[-1, -1]), rel=1e-9)
    for r, s in enumerate(series):
        later = np.column_stack([np.tile(np.eye(6)[r], (3, 1)), s.temperature[3:]])
        expected = found.expectation(r)
        assert expected.difference == pytest.approx(s.value[3:] - later @ theta, abs=1e-12)
        whole = np.diag(found.scatter**2 + s.std[3:] ** 2) + later @ covariance @ later.T
        assert expected.covariance == pytest.approx(whole, rel=1e-8)
        reference = np.append(np.eye(6)[r], found.temperature.reference)
        assert expected.level == pytest.approx(reference @ theta, rel=1e-12)
        assert expected.level_std**2 == pytest.approx(reference @ covariance @ reference, rel=1e-9)


def test_a_temperature_that_does_not_change_is_left_out():
    series = drawn(np.random.default_rng(3), warmth=0.0)
    same = [replace(s, temperature=np.full(6, 25.0)) for s in series]
    assert fit_baseline(same).temperature is None
    assert fit_baseline(same).degrees == 12
    unknown = [*series[:-1], replace(series[-1], temperature=np.full(6, np.nan))]
    assert fit_baseline(unknown).temperature is None


def test_a_robot_among_others_is_compared_as_an_externally_studentised_residual():
    """One record each, equally good: (y - mean of the others)/(their deviation √(1 + 1/n))."""
    rng = np.random.default_rng(4)
    series = drawn(rng, robots=9, records=1, baseline=1)
    series = [replace(s, std=np.array([1e-6])) for s in series]
    found = fit_baseline(series, "fleet")
    values = np.array([s.value[0] for s in series])
    for r in range(9):
        others = np.delete(values, r)
        expected = found.expectation(r)
        assert found.degrees_of(r) == 7
        assert expected.difference[0] == pytest.approx(values[r] - others.mean(), rel=1e-6)
        variance = others.var(ddof=1) * (1 + 1 / 8)
        assert expected.covariance[0, 0] == pytest.approx(variance, rel=1e-6)


def test_the_scatter_between_robots_is_common_to_all_records_of_one():
    rng = np.random.default_rng(5)
    found = fit_baseline(drawn(rng, robots=40, levels=2 + rng.standard_normal(40)), "fleet")
    covariance = found.expectation(0).covariance
    assert covariance[0, 1] == pytest.approx(1.0, rel=0.5)
    assert np.diag(covariance) - covariance[0, 1] == pytest.approx(
        found.scatter**2 + found.series[0].std ** 2, rel=1e-6
    )


def test_nothing_is_judged_without_later_records():
    found = fit_baseline(drawn(np.random.default_rng(6), records=3))
    assert found.expectation(0) is None


def test_paule_mandel_finds_the_root():
    assert paule_mandel(lambda v: 4.0 / (1.0 + v) - 1.0, 0.1) == pytest.approx(3.0, rel=1e-12)
    assert paule_mandel(lambda v: 0.5 - v, 0.0) == pytest.approx(0.5, rel=1e-12)
    assert paule_mandel(lambda v: -v, 1.0) == 0.0


def test_percent_are_the_same_for_every_robot():
    """A robot in another unit, so to speak, has the same standardised errors."""
    series = drawn(np.random.default_rng(7), warmth=-0.02)
    other = [replace(series[0], value=3 * series[0].value, std=3 * series[0].std), *series[1:]]
    ours, theirs = (fit_baseline(s).expectation(0) for s in (series, other))
    assert theirs.difference == pytest.approx(3 * ours.difference, rel=1e-6)
    assert theirs.covariance == pytest.approx(9 * ours.covariance, rel=1e-6)
    assert fit_baseline(series).levels == pytest.approx(1.0, abs=1e-6)


def test_parameters_about_zero_are_not_divided_by_their_level():
    series = drawn(np.random.default_rng(8), levels=np.array([0.0, 0.01, -0.02, 1.0, 2.0, 3.0]))
    assert (fit_baseline(series).scales == 1.0).all()
