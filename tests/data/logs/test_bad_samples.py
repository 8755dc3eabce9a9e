"""Faults that were planted into a motion are found where they are, and right logs have none."""

import numpy as np
import pytest

from pivident.data.logs.bad_samples import bad_samples, fresh_rows, marked
from pivident.data.logs.misplaced_positions import cuts
from tests.planar_log import planar_log

RATE = 500.0
N = 4000


def motion(seed=0, noise=1e-5, counts=0.0):
    """Three joints with noise of the encoders, in counts where they are coarse; and torques."""
    rng = np.random.default_rng(seed)
    t = np.arange(N) / RATE
    waves = ((0.5, 0.3, 1.0), (0.31, 1.0, 0.7), (0.8, 2.0, 0.5))
    q = np.column_stack([a * np.sin(2 * np.pi * f * t + p) for f, p, a in waves])
    q += noise * rng.standard_normal(q.shape)
    if counts:
        q = counts * np.round(q / counts)
    return q, 10.0 * q + rng.standard_normal(q.shape)


def kinds(q, tau, t=None):
    """Kind, channel and joint of what is found, and its samples."""
    return {(f.kind, f.channel, f.joint): f.rows for f in bad_samples({"q": q, "tau": tau}, t)}


@pytest.mark.parametrize("counts", [0.0, 1e-4, 1e-3, 1e-2])
@pytest.mark.parametrize("noise", [0.0, 1e-5, 1e-3])
def test_a_right_log_has_no_fault(noise, counts):
    for seed in range(5):
        q, tau = motion(seed, noise, counts)
        assert kinds(q, tau) == {}
        assert cuts(q).size == 0
        assert fresh_rows({"q": q, "tau": tau}) is None


def test_moves_between_rests_and_the_closed_loop_of_an_arm_have_none():
    log = planar_log()
    q, tau = np.deg2rad(log[:, 1:3]), log[:, 5:7]
    assert kinds(q, tau, log[:, 0]) == {}
    t = np.arange(N) / RATE
    ramp = np.clip(((t % 2.0) - 0.9) / 0.2, 0.0, 1.0)  # 0.2 s of motion, 1.8 s of rest
    smooth = ramp**3 * (10.0 - 15.0 * ramp + 6.0 * ramp**2)
    jump = np.where((t % 4.0) < 2.0, smooth, 1.0 - smooth)
    fast = np.column_stack([jump, 2.0 * jump, -jump])
    fast += 1e-5 * np.random.default_rng(1).standard_normal(fast.shape)
    assert kinds(fast, 5.0 * fast + np.random.default_rng(2).standard_normal(fast.shape)) == {}
    assert cuts(fast).size == 0


def test_one_cell_that_is_no_measurement():
    q, tau = motion()
    q[100, 1], tau[7, 2], tau[9, 0] = 1e200, np.nan, -3e12
    found = kinds(q, tau)
    assert found.keys() == {("impossible", "q", 1), ("missing", "tau", 2), ("impossible", "tau", 0)}
    assert found["impossible", "q", 1].tolist() == [100]
    assert found["missing", "tau", 2].tolist() == [7]
    clean = marked({"q": q, "tau": tau}, bad_samples({"q": q, "tau": tau}))
    assert np.isnan(clean["q"]).sum() == 1 and np.isnan(clean["tau"]).sum() == 2


@pytest.mark.parametrize("rows", [[398], [10, 398, 1373, 2052, 3602], [500, 501, 502]])
def test_rows_of_zeros_inside_a_motion(rows):
    q, tau = motion()
    q[rows] = tau[rows] = 0.0
    found = kinds(q, tau)
    assert found.keys() == {("zero rows", "", -1)}
    assert found["zero rows", "", -1].tolist() == rows


def test_an_encoder_that_freezes():
    q, tau = motion()
    q[1001:1060, 2] = q[1000, 2]
    found = kinds(q, tau)
    assert found.keys() == {("frozen position", "q", 2)}
    assert found["frozen position", "q", 2].tolist() == list(range(1001, 1060))


@pytest.mark.parametrize("share", [0.02, 0.22])
def test_rows_that_a_logger_held(share):
    q, tau = motion()
    again = np.random.default_rng(3).random(N) < share
    held = np.maximum.accumulate(np.where(again, 0, np.arange(N)))
    found = kinds(q[held], tau[held])
    assert found.keys() == {("repeated rows", "", -1)}
    assert set(found["repeated rows", "", -1].tolist()) == set(np.flatnonzero(again[1:]) + 1)


@pytest.mark.parametrize("every", [2, 5, 10])
def test_a_source_that_is_slower_than_the_log(every):
    q, tau = motion()
    held = np.arange(N) // every * every
    keep, each = fresh_rows({"q": q[held], "tau": tau[held]})
    assert each == every
    assert np.array_equal(np.flatnonzero(keep) % every, np.zeros(keep.sum(), int))


def test_rows_at_rest_may_be_equal():
    q, tau = motion()
    q[1000:3000], tau[1000:3000] = q[1000], tau[1000]
    q[3000:] += q[1000] - q[3000]
    assert kinds(q, tau) == {}
    assert fresh_rows({"q": q, "tau": tau}) is None


def test_excursions_are_named_and_places_to_cut_are_not():
    q, tau = motion()
    q[700, 0] += 0.3
    q[900:905, 0] -= 0.2
    found = kinds(q, tau)
    assert found.keys() == {("outlier", "q", 0)}
    assert found["outlier", "q", 0].tolist() == [700, *range(900, 905)]
    assert cuts(marked({"q": q}, bad_samples({"q": q}))["q"]).size == 0


@pytest.mark.parametrize("height", [0.02, -0.02, 0.05, -0.05])
def test_a_small_excursion_is_no_place_to_cut(height):
    """The motion makes one of its two steps smaller than the other."""
    for seed in range(20):
        q, _ = motion(seed)
        k = np.random.default_rng(seed).integers(100, N - 100)
        q[k, 1] += height
        assert cuts(q).size == 0


def test_a_chunk_that_stands_twice_is_a_place_to_cut():
    q, tau = motion()
    twice = np.r_[q[:1500], q[1300:]]
    assert cuts(twice).tolist() == [1500]
    over = q.copy()
    over[1500:1700] = q[1300:1500]
    assert cuts(over).tolist() == [1500, 1700]
    assert kinds(over, tau) == {}


def test_a_step_over_a_gap_in_the_stamps_is_none():
    q, _ = motion()
    left = np.r_[0:1000, 1080:N]
    assert cuts(q[left], left / RATE).size == 0
    assert cuts(q[left]).tolist() == [1000]


def test_an_angle_that_wraps_is_no_fault_of_this_kind():
    q, tau = motion()
    q[:, 0] = np.mod(3.0 * q[:, 0], 2.0 * np.pi)
    assert kinds(q, tau) == {}
    assert cuts(q).size == 0
