"""A usual rate is taken where the stamps agree with it, and no other."""

import numpy as np
import pytest

from pivident.data.logs.bags.bag_table import OwnClock
from pivident.data.logs.nominal_rate import clock_rate, usual_near
from pivident.data.logs.recognition.log_clock import read_clock
from pivident.experiment.init.clock_lines import as_the_joints_move, clock_lines

SAMPLES = 12000


def stamps(rate, lost=0.0, jitter=0.0):
    """Stamps [s] of a logger of a rate [Hz] that loses rows; jitter in periods."""
    rng = np.random.default_rng(7)
    t = np.arange(SAMPLES) / rate * (1.0 + 4e-5)  # no quartz is exact
    kept = rng.random(SAMPLES) >= lost
    t = (t + jitter / rate * rng.standard_normal(SAMPLES))[kept]
    return np.sort(t)


def sleeping(rate):
    """Stamps of a loop that sleeps and does not catch up [s]."""
    steps = np.abs(np.random.default_rng(8).standard_normal(SAMPLES)) * 0.2
    return np.cumsum((1.0 + steps) / np.mean(1.0 + steps)) / rate


@pytest.mark.parametrize(
    ("lost", "jitter", "mean"), [(0.017, 0.1, 983.0), (0.001, 0.15, 999.0), (0.017, 0.22, 983.0)]
)
def test_lost_rows_leave_the_grid_that_the_stamps_lie_on(lost, jitter, mean):
    found = clock_rate(stamps(1000.0, lost, jitter))
    assert found.mean == pytest.approx(mean, rel=2e-3)
    assert found.nominal == 1000.0 and found.on_grid and found.rate == 1000.0
    assert found.lost == pytest.approx(SAMPLES * lost, rel=0.15, abs=8)
    assert "their stamps lie on the grid of 1000 Hz" in str(found)


def test_a_loop_that_sleeps_has_the_rate_that_it_has():
    found = clock_rate(sleeping(983.0))
    assert found.nominal is None and not found.on_grid
    assert found.rate == pytest.approx(983.0, rel=1e-4) and "no usual rate" in str(found)


def test_a_usual_rate_within_the_interval_of_the_mean_is_taken():
    found = clock_rate(sleeping(999.6))
    assert found.error > 0.4 and found.nominal == 1000.0 and not found.on_grid
    assert "allows the usual 1000 Hz" in str(found)
    assert clock_rate(sleeping(997.0)).nominal is None


def test_samples_that_are_equally_spaced_lack_no_rows():
    t = stamps(997.0, 0.0, 0.2)
    assert clock_rate(t, even=True).nominal is None
    assert clock_rate(stamps(1000.0, 0.0, 0.2), even=True).nominal == 1000.0


def test_the_draft_says_the_rate_and_why():
    t = stamps(1000.0, 0.017, 0.15)
    q = np.sin(2.0 * t)
    clock = as_the_joints_move(read_clock({"t": t, "q": q}, None, None), q[:, None])
    assert clock.resample and clock.rate == 1000.0
    rate, resample = clock_lines(clock, {})
    assert (rate.key, rate.value, rate.sure) == ("rate", 1000.0, "likely")
    assert "lie on the grid of 1000 Hz" in rate.seen and resample.value is True
    rate, _ = clock_lines(clock, {"tau": OwnClock("t2", 1000.0)})
    assert rate.value == 1000.0


def test_a_rate_that_is_no_usual_one_is_not_written_down():
    t = sleeping(983.0)
    clock = as_the_joints_move(read_clock({"t": t, "q": np.sin(t)}, None, None), np.sin(t)[:, None])
    assert clock.resample and [line.key for line in clock_lines(clock, {})] == ["resample"]


def test_a_quartz_is_allowed_its_error():
    assert usual_near(999.9) == 1000.0 and usual_near(999.0) is None
