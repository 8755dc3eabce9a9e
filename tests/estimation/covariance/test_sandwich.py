"""Covariance over smooth windows against Monte Carlo, and against leaving windows out."""

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from scipy.signal import lfilter

from pivident.estimation.covariance.sandwich import sandwich
from pivident.estimation.covariance.windows import OVERLAP, windows_of
from pivident.estimation.normal_equations import JointSums, solve


def estimate(phi, tau, z=None):
    """Estimate, plain and robust deviations of one joint on one record."""
    (windows,) = windows_of([tau.size])
    joint = JointSums.empty("a", np.arange(len(phi)), windows.count)
    half = slice(0, tau.size // 2), slice(tau.size // 2, tau.size)
    for part in half:
        own = None if z is None else z[:, part]
        joint.add(phi[:, part], own, tau[part], None, list(windows.shares(part)))
    variance = np.array([joint.own_variance()])
    solution = solve([joint], variance, [f"p{k}" for k in range(len(phi))])
    robust = sandwich([joint], solution.theta, variance)
    return solution.theta, np.diag(solution.covariance), np.diag(robust), joint


def deviations(phi, make_noise, runs=200):
    """Root of the mean variances, plain and robust, over the spread of the estimates."""
    rng = np.random.default_rng(5)
    found = [estimate(phi, make_noise(rng))[:3] for _ in range(runs)]
    theta, plain, robust = (np.array(x) for x in zip(*found, strict=True))
    spread = theta.std(axis=0)
    return np.sqrt(plain.mean(axis=0)) / spread, np.sqrt(robust.mean(axis=0)) / spread


@given(st.lists(st.integers(4, 5000), min_size=1, max_size=12), st.integers(20, 700))
@settings(deadline=None)
def test_windows_share_out_every_sample_once(lengths, block):
    windows = windows_of(lengths)
    assert [w.first for w in windows] == list(np.cumsum([0] + [w.count for w in windows])[:-1])
    for own in windows:
        total = np.zeros(own.samples)
        weight = np.zeros(own.first + own.count)
        for start in range(0, own.samples, block):
            span = slice(start, min(start + block, own.samples))
            for share in own.shares(span):
                assert ((share.rising >= 0) & (share.rising <= 1)).all()
                total[span][share.part] += 1
                weight[share.window] += np.sum(1 - share.rising)
                weight[share.window + 1] += share.rising.sum()
        assert (total == 1).all()
        assert weight.sum() == pytest.approx(own.samples)


def test_a_window_left_out_moves_the_estimate_by_what_the_sandwich_sums():
    rng = np.random.default_rng(1)
    phi = rng.normal(size=(3, 600))
    z = phi + 0.1 * rng.normal(size=phi.shape)
    tau = np.array([1.0, -2.0, 0.5]) @ phi + rng.normal(size=600)
    theta, _, robust, joint = estimate(phi, tau, z)
    steps = []
    for k in range(len(joint.window_zf)):
        left = np.linalg.solve(joint.zf - joint.window_zf[k], joint.zt - joint.window_zt[k])
        steps.append(left - theta)
    assert np.allclose(robust, np.sum(np.square(steps), axis=0) / OVERLAP, rtol=1e-9)


def test_white_residuals_give_the_plain_covariance():
    t = np.arange(4000)
    phi = np.vstack([np.ones(t.size), np.sin(0.02 * t)])
    plain, robust = deviations(phi, lambda rng: rng.normal(size=t.size))
    assert np.allclose(plain, 1.0, atol=0.15)
    assert np.allclose(robust, 1.0, atol=0.15)


def test_correlation_that_the_plain_covariance_misses():
    phi = np.ones((1, 4000))
    plain, robust = deviations(phi, lambda rng: lfilter([1], [1, -0.9], rng.normal(size=4000)))
    assert plain[0] < 0.4
    assert robust[0] == pytest.approx(1.0, abs=0.15)


def test_a_spectrum_that_vanishes_at_zero_frequency():
    """Differences of white noise: sums over blocks with hard edges would be edges only."""
    t = np.arange(4000)
    phi = np.sin(2 * np.pi * t / 100)[None]
    plain, robust = deviations(phi, lambda rng: np.diff(rng.normal(size=t.size + 2), 2))
    assert plain[0] > 10  # (1 - z⁻¹)² passes little of so slow a sine
    assert 0.85 < robust[0] < 1.6
    hard = []
    rng = np.random.default_rng(5)
    for _ in range(50):
        e = np.diff(rng.normal(size=t.size + 2), 2)
        scores = np.add.reduceat(phi[0] * e, np.arange(0, t.size, t.size // 52))
        hard.append(np.sum(scores**2) / np.sum(phi**2) ** 2)
    spread = np.std([phi[0] @ np.diff(rng.normal(size=4002), 2) for _ in range(400)])
    assert np.sqrt(np.mean(hard)) > 2 * robust[0] * spread / np.sum(phi**2)


def test_variance_that_changes_along_the_record():
    t = np.arange(6000)
    loud = t < 1500
    phi = np.vstack([loud, ~loud]).astype(float)
    plain, robust = deviations(phi, lambda rng: np.where(loud, 5.0, 0.5) * rng.normal(size=t.size))
    assert plain[0] < 0.7 and plain[1] > 2
    assert np.allclose(robust, 1.0, atol=0.2)


def test_many_parameters_do_not_make_it_small():
    """Without the jackknife the residuals lack what the estimate took from them."""
    rng = np.random.default_rng(2)
    slow = lfilter([1], [1, -0.99], rng.normal(size=(20, 5200)))
    _, robust = deviations(slow, lambda rng: rng.normal(size=5200))
    assert 0.95 < np.exp(np.mean(np.log(robust))) < 1.35
