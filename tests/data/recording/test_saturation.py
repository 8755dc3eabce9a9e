import numpy as np
import pytest
from hypothesis import given, strategies as st

from pivident.data.recording.checks import clipped_samples

T = np.arange(5000) / 1000.0
Q = np.sin(1.3 * T)
TAU = 3.0 * np.cos(2.1 * T) + 0.5 * np.sin(7.0 * T)


@given(st.floats(0.3, 0.8), st.sampled_from([-1.0, 1.0]))
def test_a_torque_that_is_cut_off_is_found_exactly_where_it_is_cut(level, sign):
    limit = level * TAU.max()
    clipped = clipped_samples(sign * np.minimum(TAU, limit), Q)
    assert np.array_equal(clipped, TAU >= limit)


def test_both_limits_are_found():
    clipped = clipped_samples(np.clip(TAU, -1.0, 1.0), Q)
    assert np.array_equal(clipped, np.abs(TAU) >= 1.0)


def test_a_cut_off_torque_that_is_quantised_is_found():
    torque = np.clip(np.round(TAU / 0.05) * 0.05, -1.0, 1.0)
    assert clipped_samples(torque, Q).mean() > 0.3


@given(st.floats(0.001, 0.5), st.floats(0.0, 1.0))
def test_a_quantised_torque_is_not_taken_for_a_cut_off_one(quantum, phase):
    torque = np.floor(TAU / quantum + phase) * quantum
    assert clipped_samples(torque, Q).mean() <= 0.01


@pytest.mark.parametrize("hold", [2, 5, 20])
def test_a_torque_that_is_held_between_control_instants_is_not_cut_off(hold):
    assert not clipped_samples(np.repeat(TAU[::hold], hold), Q[: len(TAU[::hold]) * hold]).any()


def test_a_resting_joint_may_hold_its_largest_torque():
    torque, q = TAU.copy(), Q.copy()
    torque[3000:], q[3000:] = 2.0 * TAU.max(), Q[3000]
    noise = 1e-5 * np.random.default_rng(1).standard_normal(len(q))
    assert not clipped_samples(torque, q + noise).any()


def test_a_torque_that_is_zero_most_of_the_time_is_not_cut_off():
    torque = np.where(np.abs(TAU) > 2.0, TAU, 0.0)
    assert not clipped_samples(torque, Q).any()


def test_a_constant_torque_has_no_limit_to_sit_at():
    assert not clipped_samples(np.ones(100), Q[:100]).any()
