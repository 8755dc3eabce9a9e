import numpy as np
import pytest
from hypothesis import given, strategies as st

from pivident.foundation.errors import RecordingError
from pivident.signals.alignment import align_torque, torque_shift

RATE = 1000.0
TIMINGS = st.sampled_from(["held", "averaged", "sampled"])


def pushed_mass(force, h):
    """Position and speed at the instants, of a unit mass under forces held for h each."""
    speed = np.r_[0, np.cumsum(force[:-1])] * h
    position = np.r_[0, np.cumsum(speed[:-1] * h + force[:-1] * h**2 / 2)]
    return position, speed


def second_difference(q, h):
    return (q[2:] - 2 * q[1:-1] + q[:-2]) / h**2


def test_held_torque_is_what_central_differences_see():
    force = np.random.default_rng(0).standard_normal(200)
    q, _ = pushed_mass(force, 1 / RATE)
    aligned = align_torque(force, RATE)
    assert (aligned.lost_start, aligned.lost_end) == (1, 0)
    np.testing.assert_allclose(aligned.tau[1:-1], second_difference(q, 1 / RATE), atol=1e-7)


def test_log_faster_than_the_control_loop_shows_the_staircase_itself():
    force = np.repeat(np.random.default_rng(0).standard_normal(50), 5)
    q, _ = pushed_mass(force, 1 / RATE)
    aligned = align_torque(force, RATE, control_rate=RATE / 5)
    np.testing.assert_allclose(aligned.tau[1:-1], second_difference(q, 1 / RATE), atol=1e-7)


def test_log_slower_than_the_control_loop_is_late_by_half_a_control_period():
    """A smooth command, held at 5 kHz and logged at 1 kHz."""
    t = np.arange(5000) / (5 * RATE)
    command = np.sin(2 * np.pi * 5 * t)
    q, _ = pushed_mass(command, 1 / (5 * RATE))
    log, ddq = command[::5], second_difference(q[::5], 1 / RATE)

    def error(control_rate):
        aligned = align_torque(log, RATE, control_rate=control_rate).tau[1:-1]
        return np.abs(aligned - ddq)[1:].max()

    assert error(5 * RATE) < 2e-4
    assert error(5 * RATE) < error(RATE) / 20


def test_averages_over_the_period_before_are_moved_forward():
    force = np.random.default_rng(0).standard_normal(200)
    q, _ = pushed_mass(force, 1 / RATE)
    averaged = np.r_[0, force[:-1]]
    aligned = align_torque(averaged, RATE, "averaged")
    assert (aligned.lost_start, aligned.lost_end) == (0, 1)
    np.testing.assert_allclose(aligned.tau[1:-1], second_difference(q, 1 / RATE), atol=1e-7)


def test_a_channel_logged_late_is_advanced():
    tau = np.arange(50.0)
    late = np.r_[np.zeros(3), tau[:-3]]
    aligned = align_torque(late, RATE, "sampled", delay=3 / RATE)
    assert (aligned.lost_start, aligned.lost_end) == (0, 3)
    np.testing.assert_array_equal(aligned.tau[:-3], tau[:-3])


def test_a_channel_logged_early_is_put_back():
    tau = np.arange(50.0)
    aligned = align_torque(tau, RATE, "sampled", delay=-2 / RATE)
    assert (aligned.lost_start, aligned.lost_end) == (2, 0)
    np.testing.assert_array_equal(aligned.tau[2:], tau[:-2])


@given(TIMINGS, st.floats(-0.02, 0.02), st.sampled_from([500.0, 1000.0, 4000.0]))
def test_a_straight_line_is_moved_exactly(timing, delay, control_rate):
    tau = np.column_stack([np.arange(100.0), -3 * np.arange(100.0)])
    options = {"control_rate": control_rate, "delay": delay}
    shift = torque_shift(RATE, timing, **options)
    aligned = align_torque(tau, RATE, timing, **options)
    good = slice(aligned.lost_start, 100 - aligned.lost_end)
    np.testing.assert_allclose(aligned.tau[good], tau[good] - shift * np.array([1, -3]), atol=1e-6)
    assert aligned.tau.shape == tau.shape


def test_nothing_to_do_changes_nothing():
    tau = np.random.default_rng(0).standard_normal((20, 2))
    aligned = align_torque(tau, RATE, "sampled")
    np.testing.assert_array_equal(aligned.tau, tau)
    assert aligned.lost_start == aligned.lost_end == 0


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"timing": "late"}, "held, averaged or sampled"),
        ({"rate": 0.0}, "positive"),
        ({"control_rate": -1.0}, "positive"),
        ({"delay": 5.0}, "check the delay"),
        ({"delay": float("nan")}, "finite"),
    ],
)
def test_impossible_timings_are_refused(options, message):
    with pytest.raises(RecordingError, match=message):
        align_torque(np.zeros(100), **{"rate": RATE, **options})
