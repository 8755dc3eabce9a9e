"""Moves whose timing is known are found again; other motions become splines."""

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from pivident.estimation.control_law.reference_reconstruction import (
    Move,
    PointToPoint,
    QuinticMove,
    fit_point_to_point,
    reconstruct_reference,
)
from pivident.signals.random_walk import smooth_channels

RATE = 1000.0
POINTS = np.array([[0.0, 0.0], [1.0, -0.5], [0.2, 0.8], [-0.6, 0.1]])


def trapezoids():
    moves = (Move(0.1, 0.12, 0.3, 0.05), Move(0.9, 0.2, 0.25, 0.04), Move(1.8, 0.15, 0.2, 0.06))
    return PointToPoint(moves, POINTS)


def quintics():
    moves = (QuinticMove(0.1, 0.7), QuinticMove(0.95, 0.6), QuinticMove(1.7, 0.9))
    return PointToPoint(moves, POINTS)


@given(st.floats(0.02, 0.5), st.floats(0.0, 1.0), st.floats(0.005, 0.3))
@settings(max_examples=40, deadline=None)
def test_a_move_goes_from_rest_to_rest(acceleration, cruise, rounding):
    move = Move(0.3, acceleration, cruise, rounding)
    s, speed, ddq = move.shape(np.array([0.3, 0.3 + move.duration, 0.3 + 2 * move.duration]))
    np.testing.assert_allclose(s, [0, 1, 1], atol=1e-7)
    np.testing.assert_allclose(speed, 0, atol=1e-6)
    np.testing.assert_allclose(ddq, 0, atol=1e-5)


@pytest.mark.parametrize("motion", [trapezoids(), quintics()], ids=["trapezoid", "quintic"])
def test_derivatives_are_those_of_the_positions(motion):
    t = np.arange(0, 2.8, 1e-4)
    q, dq, ddq = motion.reference(t)
    np.testing.assert_allclose(np.gradient(q, 1e-4, axis=0)[2:-2], dq[2:-2], atol=2e-3)
    np.testing.assert_allclose(np.gradient(dq, 1e-4, axis=0)[2:-2], ddq[2:-2], atol=0.3)


@pytest.mark.parametrize("motion", [trapezoids(), quintics()], ids=["trapezoid", "quintic"])
def test_timing_and_via_points_are_found_again(motion):
    t = np.arange(0, 2.9, 1 / RATE)
    q = motion.reference(t)[0] + 1e-5 * np.random.default_rng(0).normal(size=(t.size, 2))
    smoothed = smooth_channels(q, RATE)
    found = fit_point_to_point(smoothed.q, smoothed.dq, RATE)
    assert len(found.moves) == 3
    np.testing.assert_allclose(found.points, POINTS, atol=1e-4)
    for ours, true in zip(found.moves, motion.moves, strict=True):
        assert ours.start == pytest.approx(true.start, abs=4e-3)
        assert ours.duration == pytest.approx(true.duration, abs=8e-3)
    speed, acceleration = found.limits
    np.testing.assert_allclose(speed, motion.limits[0], rtol=0.01)
    np.testing.assert_allclose(acceleration, motion.limits[1], rtol=0.1)


def test_a_move_that_the_record_cuts_off_is_continued():
    t = np.arange(0, 2.9, 1 / RATE)
    q = quintics().reference(t)[0][:2200]  # in the middle of the third move
    smoothed = smooth_channels(q, RATE)
    found = fit_point_to_point(smoothed.q, smoothed.dq, RATE)
    np.testing.assert_allclose(found.points[-1], POINTS[-1], atol=0.02)


def test_a_reconstructed_reference_hardly_follows_the_noise():
    t = np.arange(0, 2.9, 1 / RATE)
    clean = trapezoids().reference(t)[0]
    noise = 1e-4 * np.random.default_rng(1).normal(size=clean.shape)
    found = reconstruct_reference(clean + noise, RATE)
    assert found.kind == "point_to_point" and found.freedom < 0.005
    assert np.abs(found.q - clean).max() < 2e-4
    leaked = np.mean((found.q - clean) * noise) / np.mean(noise**2)
    assert abs(leaked) < 0.02
    assert "3 moves" in str(found)


def test_another_motion_becomes_a_spline_and_says_so():
    t = np.arange(0, 3, 1 / RATE)
    q = np.stack([np.sin(2 * np.pi * t), 0.3 * np.cos(5 * t) + 0.1 * np.sin(11 * t)], axis=1)
    found = reconstruct_reference(q + 1e-5 * np.random.default_rng(2).normal(size=q.shape), RATE)
    assert found.kind == "spline" and found.moves is None
    assert np.abs(found.q - q)[50:-50].max() < 1e-4
    assert "smoothing spline" in str(found) and 0 < found.freedom <= 1
