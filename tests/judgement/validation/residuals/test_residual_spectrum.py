"""Spectra of residuals: level, band, gaps, and the noise model's spectrum."""

import numpy as np
import pytest
from scipy.signal import lfilter, welch

from pivident.judgement.validation.residuals.residual_spectrum import welch_spectrum

RATE = 1000.0


def white(samples, seed=0):
    return np.random.default_rng(seed).standard_normal(samples)


@pytest.mark.parametrize("samples", [600, 5000, 45_000])
def test_of_white_noise_five_percent_of_the_bins_lie_outside(samples):
    outside, level = [], []
    for seed in range(40):
        found = welch_spectrum([white(samples, seed)], RATE)
        outside.append(found.outside(2 / RATE))
        level.append(found.density.mean())
    assert 0.035 < np.mean(outside) < 0.07
    assert np.mean(level) == pytest.approx(2 / RATE, rel=0.02)


def test_the_estimate_is_welchs():
    x = white(8192)
    found = welch_spectrum([x], RATE)
    f, density = welch(x, RATE, "hann", found.length, detrend=False)
    narrow = np.searchsorted(found.frequency, 4 * RATE / found.length)
    for k in range(narrow):
        near = np.argmin(np.abs(f - found.frequency[k]))
        assert found.density[k] == pytest.approx(density[near], rel=0.05)


def test_a_coloured_residual_leaves_the_band_and_fits_its_own_spectrum():
    x = lfilter([1.0], [1.0, -0.9], white(40_000))
    found = welch_spectrum([x], RATE)
    true = 2 / RATE / np.abs(1 - 0.9 * np.exp(-2j * np.pi * found.frequency / RATE)) ** 2
    assert found.outside(2 / RATE) > 0.8
    assert found.outside(true) < 0.12


@pytest.mark.parametrize(("share", "filled"), [(0.003, False), (0.3, True)])
def test_gaps_do_not_change_the_level(share, filled):
    outside = []
    for seed in range(30):
        x = white(6000, seed)
        x[np.random.default_rng(99 + seed).random(6000) < share] = np.nan
        found = welch_spectrum([x[:2500], x[2500:]], RATE)
        assert found.filled == filled
        outside.append(found.outside(2 / RATE))
    assert np.mean(outside) < 0.08


def test_too_few_samples_have_no_spectrum():
    assert welch_spectrum([white(60)], RATE) is None
    assert welch_spectrum([np.full(5000, np.nan)], RATE) is None
    assert welch_spectrum([], RATE) is None
