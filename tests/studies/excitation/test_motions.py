from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, strategies as st

from pivident.foundation.codec import decode
from pivident.foundation.text.plain_values import plain
from pivident.loop.simulation.reference import trapezoidal_moves
from pivident.studies.excitation.motions import DWELL, ExcitingMotion, MotionFamily, MotionTable

KINDS = {"fourier": 9, "splines": 12, "postures": 7}


def motion(kind, seed=0, duration=8.0, joints=3):
    rng = np.random.default_rng(seed)
    family = MotionFamily(kind, duration, KINDS[kind])
    return ExcitingMotion(family, rng.standard_normal((family.size, joints)))


@pytest.mark.parametrize("kind", KINDS)
def test_a_motion_rests_at_its_start_at_both_ends(kind):
    made = motion(kind)
    q, dq, ddq, _ = made.at(np.array([0.0, made.duration]))
    np.testing.assert_allclose(q, [made.start, made.start], atol=1e-12)
    np.testing.assert_allclose(dq, 0.0, atol=1e-12)
    np.testing.assert_allclose(ddq, 0.0, atol=1e-11)


@pytest.mark.parametrize("kind", KINDS)
def test_speeds_and_accelerations_are_derivatives(kind):
    made = motion(kind)
    t = np.linspace(0.1, made.duration - 0.1, 20_001)
    values = made.at(t)
    for order in range(2 if kind == "postures" else 3):
        slope = np.gradient(values[order], t, axis=0, edge_order=2)[1:-1]
        size = np.abs(values[order + 1]).max()
        np.testing.assert_allclose(slope, values[order + 1][1:-1], atol=2e-3 * size)


@pytest.mark.parametrize("kind", KINDS)
def test_every_function_moves_the_robot(kind):
    family = MotionFamily(kind, 8.0, KINDS[kind])
    functions = family.functions(np.linspace(0.0, 8.0, 500))
    assert np.linalg.matrix_rank(functions[0]) == family.size


def test_moves_between_postures_are_those_of_an_industrial_controller():
    made = motion("postures")
    postures = made.postures
    duration = made.family.move_duration
    ways = np.abs(np.diff(postures, axis=0)).max(axis=0)
    rise = 0.3 * duration
    for k in range(2):
        own = np.abs(postures[k + 1] - postures[k])
        speeds = own / (duration - rise)
        accelerations = speeds / rise / 0.75
        reference, *_ = trapezoidal_moves(
            postures[k : k + 2], speeds, accelerations, 1000.0, int(1000 * duration) - 1
        )
        t = k * (duration + DWELL) + np.arange(len(reference)) / 1000.0
        np.testing.assert_allclose(made.at(t)[0], reference, atol=1e-9 + 1e-9 * ways.max())


def test_postures_are_passed_in_their_order_and_held():
    made = motion("postures")
    starts = np.arange(made.family.size + 1) * (made.family.move_duration + DWELL)
    held = np.minimum(starts - 0.5 * DWELL, made.duration)[1:]
    np.testing.assert_allclose(made.at(held)[0], made.postures[1:], atol=1e-12)
    assert motion("fourier").postures is None


def test_a_fourier_motion_is_a_series_and_a_quintic():
    """Between its ends the fourth difference of the quintic is known, and the rest is periodic."""
    made = motion("fourier", joints=1)
    t = np.arange(200) / 200 * made.duration
    functions = made.family.functions(t)
    x = t / made.duration
    quintics = np.vander(x, 6)
    waves = [f(2 * np.pi * k * x) for k in range(1, 5) for f in (np.sin, np.cos)]
    basis = np.column_stack([quintics, *waves])
    rest = functions[0] - basis @ np.linalg.lstsq(basis, functions[0], rcond=None)[0]
    assert np.abs(rest).max() < 1e-10


@given(kind=st.sampled_from(sorted(KINDS)), seed=st.integers(0, 1000))
def test_plain_values_give_the_motion_back_bit_for_bit(kind, seed):
    made = motion(kind, seed)
    again = decode(MotionTable, plain(MotionTable.of(made))).motion()
    np.testing.assert_array_equal(again.coefficients, made.coefficients)
    assert again.family == made.family


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"kind": "walk", "duration": 5.0, "coefficients": [[1.0]] * 5}, "kind = 'walk': must be"),
        ({"kind": "fourier", "duration": -1.0, "coefficients": [[1.0]] * 5}, "duration"),
        ({"kind": "fourier", "duration": 5.0, "coefficients": [[1.0]] * 4}, "harmonics"),
        ({"kind": "splines", "duration": 5.0, "coefficients": [[np.nan]] * 5}, "finite"),
    ],
)
def test_plain_values_of_no_motion_are_refused(values, message):
    with pytest.raises(ValueError, match=message):
        decode(MotionTable, values).motion()


@pytest.mark.parametrize("kind", ["fourier", "splines", "postures"])
def test_rounds_repeat_the_motion(kind):
    rng = np.random.default_rng(3)
    family = MotionFamily(kind, 6.0, 9, rounds=3)
    motion = ExcitingMotion(family, rng.standard_normal((9, 2)))
    assert motion.duration == 18.0 and motion.one_round.duration == 6.0
    t = np.linspace(0.0, 5.99, 200)
    first = motion.one_round.at(t)
    for k in range(3):
        np.testing.assert_allclose(motion.at(t + 6.0 * k), first, atol=1e-8)
    ends = motion.at(np.array([0.0, 6.0, 12.0, 18.0, 99.0]))
    np.testing.assert_allclose(ends[0], np.tile(motion.start, (5, 1)), atol=1e-9)
    assert np.abs(ends[1:3]).max() < 1e-9
    assert MotionTable.of(motion).motion().family == family
    if kind == "postures":
        assert motion.postures.shape == (1 + 3 * 9, 2)
        np.testing.assert_array_equal(motion.postures[:10], motion.one_round.postures)
        np.testing.assert_array_equal(motion.postures[9:19], motion.one_round.postures)


@pytest.mark.parametrize("kind", ["splines", "postures"])
def test_between_breakpoints_a_motion_is_a_quintic(kind):
    family = MotionFamily(kind, 6.0, 9)
    points = family.breakpoints
    assert points[0] == 0.0 and points[-1] == 6.0 and (np.diff(points) > -1e-12).all()
    for a, b in pairwise(points):
        if b - a < 1e-6:
            continue
        t = np.linspace(a, b, 30)[1:-1]
        x = (t - t.mean()) / (b - a)
        values = family.functions(t)[0]
        fitted = np.vander(x, 6) @ np.linalg.lstsq(np.vander(x, 6), values, rcond=None)[0]
        np.testing.assert_allclose(fitted, values, atol=1e-9)
