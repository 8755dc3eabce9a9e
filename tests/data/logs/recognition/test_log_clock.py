"""The clock is found in whatever unit and form it was logged."""

import numpy as np
import pytest

from pivident.data.logs.recognition.log_clock import read_clock, speed_rate
from pivident.data.logs.timestamps import stretches

T = np.arange(2000) / 250.0
Q = np.sin(T)


@pytest.mark.parametrize(
    ("name", "stamps", "unit"),
    [
        ("time", T, "s"),
        ("timestamp", 1.7e9 + T, "s"),
        ("stamp", 1.7e12 + 1e3 * T, "ms"),
        ("header.stamp", 1.7e18 + 1e9 * T, "ns"),
        ("t_us", 1e6 * T, "us"),
        ("Time [ms]", 1e3 * T, "ms"),
        ("column_1", T, "s"),
    ],
)
def test_unit_and_rate_follow_from_name_and_values(name, stamps, unit):
    clock = read_clock({"q": Q, name: stamps}, None, None)
    assert clock.column == name and clock.unit == unit
    assert abs(clock.rate / 250.0 - 1.0) < 1e-3
    assert not clock.by_rate


def test_stamps_that_repeat_leave_their_rate_only():
    clock = read_clock({"time": np.floor(T * 100) / 100, "q": Q}, None, None)
    assert clock.column is None and clock.by_rate and clock.sure == "assumed"
    assert abs(clock.rate - 250.0) < 1.0


def test_messages_that_arrived_together_lie_in_a_gap():
    t = T.copy()
    t[500:521] = t[520]
    clock = read_clock({"time": t, "q": Q}, None, None)
    assert clock.column == "time" and clock.together == 20
    assert clock.resample and not clock.by_rate
    kept = np.delete(np.arange(len(t)), np.arange(500, 521))
    np.testing.assert_array_equal(clock.seconds[kept], t[kept])
    steps = np.diff(clock.seconds)
    assert (steps > 0).all() and steps[499] > 0.04 and steps[520] > 0.04
    seconds = stretches(clock.seconds).longest
    assert seconds[0] >= t[521] and seconds[1] == pytest.approx(t[-1])


def test_one_stamp_twice_is_corrected_and_a_row_twice_left_out():
    t = T.copy()
    t[500] = t[499]
    clock = read_clock({"time": t, "q": Q}, None, None)
    assert not clock.by_rate and clock.twice == () and np.array_equal(clock.seconds, T)
    rows = np.sort(np.r_[np.arange(2000), 700, 900])
    clock = read_clock({"time": T[rows], "q": Q[rows]}, None, None)
    assert not clock.by_rate and not clock.resample and clock.twice == (701, 902)
    assert (np.diff(clock.seconds) > 0.0).all()
    assert "2 row(s) were logged twice, the first is 701" in clock.seen


@pytest.mark.parametrize("change", ["many", "backward"])
def test_other_repeated_stamps_leave_the_rate_only(change):
    t = T.copy()
    if change == "many":
        for k in range(0, 2000, 100):
            t[k : k + 21] = t[k + 20] if k + 20 < 2000 else t[-1]
    else:
        t[500:521] = t[520]
        t[1000:] -= 0.5
    assert read_clock({"time": t, "q": Q}, None, None).by_rate


def test_irregular_stamps_ask_for_interpolation():
    t = T + 8e-4 * np.sin(77 * np.arange(2000))
    assert read_clock({"time": t, "q": Q}, None, None).resample
    assert not read_clock({"time": T, "q": Q}, None, None).resample


def test_seconds_and_nanoseconds_in_two_columns_tell_the_rate():
    total = 100.7 + T
    columns = {"stamp.sec": np.floor(total), "stamp.nanosec": 1e9 * (total % 1.0), "q": Q}
    clock = read_clock(columns, None, None)
    assert clock.column is None and abs(clock.rate - 250.0) < 0.5


def test_logged_speeds_tell_a_rate_that_nobody_logged():
    rate = speed_rate(Q[:, None], np.cos(T)[:, None])
    assert rate is not None and rate == pytest.approx((250.0, 250.0), abs=0.1)
    assert read_clock({"q": Q}, rate, None).sure == "likely"
    assert read_clock({"q": Q}, None, None).sure == "assumed"
    assert read_clock({"q": Q}, None, 400.0).rate == 400.0
    # Unknown units of stamps, too: steps of 4 are ms.
    assert read_clock({"time": 1e3 * T, "q": Q}, rate, None).unit == "ms"


@pytest.mark.parametrize("true", [250.0, 262.0])
def test_noise_of_positions_does_not_lower_the_rate_that_speeds_tell(true):
    """Single differences of counted positions said 230 Hz for 250."""
    rng = np.random.default_rng(3)
    t = np.arange(4000) / true
    q = np.round(np.sin(t) / 2e-3) * 2e-3 + 1e-3 * rng.standard_normal(t.size)
    rate = speed_rate(q[:, None], np.cos(t)[:, None])
    assert rate is not None and rate[0] < true * 1.001 and rate[1] > true * 0.999
    clock = read_clock({"q": q}, rate, None)
    assert clock.rate == pytest.approx(true, rel=0.005) and clock.by_rate
    assert (clock.rate == 250.0) == ("allows the usual 250 Hz" in clock.seen) == (true == 250.0)


def test_rows_that_were_lost_do_not_lower_the_rate():
    kept = np.delete(np.arange(2000), np.arange(40, 2000, 40))
    clock = read_clock({"time": T[kept], "q": Q[kept]}, None, None)
    assert clock.rate == 250.0 and clock.resample
