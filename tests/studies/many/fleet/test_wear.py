"""Wear and temperature against dense least squares over all records."""

import numpy as np
import pytest
from scipy.stats import t

from pivident.studies.many.fleet.baseline import fit_baseline
from pivident.studies.many.fleet.control_chart import separate_wear
from tests.studies.many.fleet.series import drawn


def test_rates_are_those_of_dense_least_squares():
    series = drawn(np.random.default_rng(0), robots=4, records=7, warmth=-0.02)
    for k, s in enumerate(series):
        s.value[:] += 0.01 * k * s.position
    baseline = fit_baseline(series, relative=False)
    found = separate_wear(baseline)
    rows, y, w = [], [], []
    for r, s in enumerate(series):
        for k in range(s.records):
            level, rate = np.eye(4)[r], np.eye(4)[r] * s.position[k]
            rows.append([*level, *rate, s.temperature[k]])
            y.append(s.value[k])
            w.append(1.0 / (baseline.scatter**2 + s.std[k] ** 2))
    x, y, w = np.array(rows), np.array(y), np.array(w)
    covariance = np.linalg.inv(x.T @ (w[:, None] * x))
    theta = covariance @ x.T @ (w * y)
    half = t.ppf(0.975, baseline.degrees) * np.sqrt(np.diag(covariance))
    assert found.temperature.value == pytest.approx(theta[-1], rel=1e-8)
    assert found.temperature.high - found.temperature.value == pytest.approx(half[-1], rel=1e-8)
    for r, rate in enumerate(found.robots.values()):
        assert rate.value == pytest.approx(theta[4 + r], rel=1e-8)
        assert rate.high - rate.value == pytest.approx(half[4 + r], rel=1e-8)


def test_intervals_cover_the_truth():
    rng, covered, count = np.random.default_rng(1), 0, 0
    for _ in range(150):
        series = drawn(rng, robots=5, records=6, warmth=-0.02)
        for s in series:
            s.value[:] += 0.01 * s.position
        wear = separate_wear(fit_baseline(series))
        for rate, truth in [(wear.temperature, -0.02), *((r, 0.01) for r in wear.robots.values())]:
            covered += rate.low < truth < rate.high
            count += 1
    assert 0.92 < covered / count < 0.99  # the scatter errs to the safe side


def test_warmth_that_goes_with_time_cannot_be_told_from_wear():
    series = drawn(np.random.default_rng(2), robots=1, records=6, warmth=0.0)
    series[0].temperature[:] = 20.0 + series[0].position
    wear = separate_wear(fit_baseline(series))
    assert wear.temperature is None


def test_a_robot_recorded_once_has_no_rate():
    series = drawn(np.random.default_rng(3), robots=3, records=1, baseline=1)
    assert set(separate_wear(fit_baseline(series, "fleet")).robots.values()) == {None}
