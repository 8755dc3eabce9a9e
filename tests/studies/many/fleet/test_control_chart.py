"""False alarms no more often than promised; sudden and slow changes found."""

import numpy as np
import pytest
from scipy.stats import binom, t

from pivident.studies.many.fleet.baseline import fit_baseline
from pivident.studies.many.fleet.control_chart import FORGETTING, draw_charts, find_alarms
from tests.studies.many.fleet.series import changed, drawn


def alarms(fleets, level, kind="robot", planned=None):
    charts = draw_charts([fit_baseline(series, kind) for series in fleets], level, planned)
    return find_alarms(charts)


@pytest.mark.parametrize(
    ("options", "kind"),
    [
        ({"scatter": 0.02}, "robot"),
        ({"scatter": 0.02, "warmth": -0.02}, "robot"),
        ({"scatter": 0.0, "baseline": 2}, "robot"),
        ({"scatter": 0.02, "records": 2, "baseline": 1}, "fleet"),
    ],
)
def test_fleets_without_a_change_give_alarms_no_more_often_than_the_level(options, kind):
    """At a level of 20 % over the whole fleet, of 150 fleets; the bound is one of 0.1 %."""
    rng = np.random.default_rng(0)
    fleets, level = 150, 0.2
    found = sum(
        bool(alarms([drawn(rng, **options), drawn(rng, **options)], level, kind))
        for _ in range(fleets)
    )
    assert found <= binom.isf(1e-3, fleets, level)


def test_the_level_is_not_wasted_where_the_model_is_exact():
    """One later record, equally good ones: both charts are Student's t, m = 2 tests for each."""
    rng, found, fleets = np.random.default_rng(1), 0, 250
    for _ in range(fleets):
        series = drawn(rng, robots=4, records=4, scatter=0.05, std=1e-6)
        found += bool(alarms([series], 0.4))
    # of 8 tests 4 and 4 are the same: 1 - (1 - 0.4/8)^4 = 18.5 %, but for a common scatter
    assert binom.ppf(1e-3, fleets, 0.16) <= found <= binom.isf(1e-3, fleets, 0.20)


def test_a_sudden_change_is_found_with_its_size_and_date():
    rng = np.random.default_rng(2)
    series = drawn(rng, robots=20, records=8, scatter=0.01, std=0.005)
    series[7] = changed(series[7], 5, 1.1)
    (alarm,) = alarms([series], 0.05)
    assert (alarm.robot, alarm.log, alarm.time) == ("arm_7", "arm_7/5", "5")
    truth = 0.1 * series[7].value[:5].mean()
    assert alarm.low < truth < alarm.high and alarm.records == 3
    assert alarm.relative[0] == pytest.approx(0.1, abs=0.02)
    assert alarm.p_value < 0.05


def test_a_slow_change_is_seen_by_the_weighted_mean_first():
    """3 % in steps too small for a single record."""
    rng, first = np.random.default_rng(3), []
    for _ in range(30):
        series = drawn(rng, robots=12, records=24, baseline=6, scatter=0.02, std=0.002)
        series[0].value[6:] += 0.004 * np.arange(18)
        charts = draw_charts([fit_baseline(series)], 0.05)
        chart = next(c for c in charts if c.series.robot == "arm_0")
        inside = [
            int(np.argmax(z > chart.limit)) if (z > chart.limit).any() else 99
            for z in (np.abs(chart.slow), np.abs(chart.sudden))
        ]
        first.append(inside)
    slow, sudden = np.median(first, axis=0)
    assert slow <= sudden - 2


def test_deviations_of_the_weighted_mean_are_those_of_simulation():
    rng, z = np.random.default_rng(4), []
    for _ in range(600):
        chart = draw_charts([fit_baseline(drawn(rng, robots=3, records=7))], 0.05)[0]
        z.append(chart.slow)
    z = np.array(z)
    expected = t.std(chart.degrees)  # 6 degrees of freedom of the common scatter
    assert z.std(axis=0) == pytest.approx(expected, rel=0.15)


def test_weights_forget():
    series = drawn(np.random.default_rng(5), records=6)
    chart = draw_charts([fit_baseline(series)], 0.05)[0]
    weights = (1 - FORGETTING) ** np.arange(3)[::-1] / chart.std**2
    assert chart.mean[-1] == pytest.approx(weights @ chart.difference / weights.sum())
    assert chart.mean[0] == chart.difference[0]


def test_planned_records_keep_the_limit_where_it_is():
    """Looking every week counts all looks of the period at once."""
    rng = np.random.default_rng(6)
    series = drawn(rng, records=9)
    limits = []
    for records in (4, 6, 9):
        so_far = [_first(s, records) for s in series]
        charts = draw_charts([fit_baseline(so_far)], 0.05, planned=6)
        limits.append(charts[0].limit)
        assert charts[0].tests == 2 * 6 * 6
    assert limits[0] == limits[1] == limits[2]
    assert draw_charts([fit_baseline(series)], 0.05)[0].tests == 2 * 6 * 6
    assert draw_charts([fit_baseline(series)], 0.05, planned=2)[0].tests == 2 * 6 * 6


def test_other_temperatures_are_no_change():
    rng = np.random.default_rng(7)
    series = drawn(rng, robots=20, records=6, scatter=0.005, std=0.002, warmth=-0.04)
    cold = series[3]
    cold.temperature[3:] -= 40.0
    cold.value[3:] += 0.04 * 40.0
    assert not alarms([series], 0.05)
    blind = [_without_temperature(s) for s in series]
    assert {a.robot for a in alarms([blind], 0.05)} == {"arm_3"}


def _first(series, records):
    from dataclasses import replace

    cut = {k: getattr(series, k)[:records] for k in ("logs", "times", "position", "value", "std")}
    return replace(series, temperature=series.temperature[:records], **cut)


def _without_temperature(series):
    from dataclasses import replace

    return replace(series, temperature=np.full(series.records, np.nan))


def test_robots_of_other_sizes_warm_by_the_same_percentage():
    """1 % per kelvin of levels that differ twofold is no change of any robot."""
    rng = np.random.default_rng(8)
    series = []
    for level in np.linspace(1.0, 2.0, 20):
        (own,) = drawn(rng, robots=1, scatter=0.005, std=0.002, warmth=-0.01, levels=[1.0])
        series.append(_scaled_by(own, level, f"arm_{level:.2f}"))
    cold = series[0]
    cold.value[3:] += 0.01 * 15.0 * 1.0
    cold.temperature[3:] -= 15.0
    assert not alarms([series], 0.05)


def _scaled_by(series, factor, robot):
    from dataclasses import replace

    return replace(series, robot=robot, value=factor * series.value, std=factor * series.std)
